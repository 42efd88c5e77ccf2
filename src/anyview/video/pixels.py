"""Frames as networks see them: uint8 pixels to [-1, 1] and back."""

import cv2
import numpy as np
import torch
from torch import Tensor


def to_input(frames: np.ndarray | Tensor) -> Tensor:
    """Network input (..., 3, H, W) in [-1, 1], float32, of uint8 ``frames`` (..., H, W, 3)."""
    pixels = frames if isinstance(frames, Tensor) else torch.tensor(frames)
    return pixels.movedim(-1, -3).to(torch.float32).div_(127.5).sub_(1.0)


def resize(frames: np.ndarray, size: int) -> np.ndarray:
    """Square uint8 ``frames`` (..., H, H, 3) with sides of ``size`` pixels; unchanged if they have these."""
    if frames.shape[-2] == size:
        return frames
    flat = frames.reshape(-1, *frames.shape[-3:])
    resized = np.stack([cv2.resize(frame, (size, size), interpolation=cv2.INTER_LINEAR) for frame in flat])
    return resized.reshape(*frames.shape[:-3], size, size, 3)


def to_frames(output: Tensor) -> np.ndarray:
    """uint8 frames (..., H, W, 3) of network output (..., 3, H, W)."""
    pixels = output.detach().float().add(1.0).mul(127.5).round_().clamp_(0.0, 255.0)
    return pixels.to(torch.uint8).movedim(-3, -1).cpu().numpy()

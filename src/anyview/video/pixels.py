"""Frames as networks see them: uint8 pixels to [-1, 1] and back."""

import numpy as np
import torch
from torch import Tensor


def to_input(frames: np.ndarray | Tensor) -> Tensor:
    """Network input (..., 3, H, W) in [-1, 1], float32, of uint8 ``frames`` (..., H, W, 3)."""
    pixels = frames if isinstance(frames, Tensor) else torch.tensor(frames)
    return pixels.movedim(-1, -3).to(torch.float32).div_(127.5).sub_(1.0)


def to_frames(output: Tensor) -> np.ndarray:
    """uint8 frames (..., H, W, 3) of network output (..., 3, H, W)."""
    pixels = output.detach().float().add(1.0).mul(127.5).round_().clamp_(0.0, 255.0)
    return pixels.to(torch.uint8).movedim(-3, -1).cpu().numpy()

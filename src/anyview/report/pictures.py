"""Frames as pictures for the page: clips that play in the browser, and strips of stills."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

_QUALITY = 90
_LOSSLESS = 101  # OpenCV: above 100
_MILLISECONDS, _PAUSE = 100, 1500  # that a frame of an animation stays, and the last one
_HEAD = 24  # pixels for the text over a view


@dataclass(frozen=True)
class Strip:
    """Rows of (label, frames uint8 RGB (n, H, W, 3)), side by side in time; ``steps`` are the n times."""

    rows: tuple[tuple[str, np.ndarray], ...]
    steps: tuple[int, ...]


@dataclass(frozen=True)
class Clip:
    """A clip as one picture, its ``count`` frames one under another, for a player that shows one."""

    source: str
    count: int
    width: int
    height: int
    caption: str


def every(frames: np.ndarray, stride: int) -> tuple[int, ...]:
    """Every ``stride``-th step of a clip (T, H, W, 3), and always the last: where things end."""
    last = len(frames) - 1
    steps = [step for step in range(0, last, stride) if last - step >= stride / 2]
    return (*steps, last)


def make_strip(rows: Sequence[tuple[str, np.ndarray]], stride: int = 7) -> Strip:
    """A strip of every ``stride``-th frame of clips of equal length."""
    steps = every(rows[0][1], stride)
    return Strip(tuple((label, frames[list(steps)]) for label, frames in rows), steps)


def make_clip(frames: np.ndarray, caption: str, stride: int = 2) -> Clip:
    """A clip of every ``stride``-th frame of ``frames``, uint8 RGB (T, H, W, 3)."""
    kept = frames[list(every(frames, stride))]
    count, height, width, _ = kept.shape
    return Clip(_webp(kept.reshape(count * height, width, 3), lossless=False), count, width, height, caption)


def label_view(frames: np.ndarray, text: str, scale: int) -> np.ndarray:
    """``frames``, uint8 RGB (T, H, W, 3), ``scale`` times as large, under a white line that says ``text``."""
    large = frames.repeat(scale, axis=1).repeat(scale, axis=2)
    head = np.full((_HEAD, large.shape[2], 3), 255, np.uint8)
    cv2.putText(head, text, (4, _HEAD - 7), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (30, 30, 30), 1, cv2.LINE_AA)
    return np.concatenate([np.broadcast_to(head, (len(large), *head.shape)), large], axis=1)


def animated_webp(parts: Sequence[np.ndarray]) -> bytes:
    """Clips, uint8 RGB (T, H, W, 3), one after another for ever, each at twice its speed; its end stays."""
    pictures: list[np.ndarray] = []
    milliseconds: list[int] = []
    for frames in parts:
        kept = frames[list(every(frames, 2))]
        pictures += [cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) for frame in kept]
        milliseconds += [_MILLISECONDS] * (len(kept) - 1) + [_PAUSE]
    animation = cv2.Animation()
    animation.frames, animation.durations = pictures, milliseconds
    done, content = cv2.imencodeanimation(".webp", animation, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
    if not done:
        raise RuntimeError("OpenCV cannot encode WebP")
    return content.tobytes()


def row_uri(frames: np.ndarray) -> str:
    """Frames (n, H, W, 3) in one row, each with a white line to its right, as a data URI."""
    lined = np.pad(frames, ((0, 0), (0, 0), (0, 1), (0, 0)), constant_values=255)
    return _webp(np.concatenate(list(lined), axis=1), lossless=True)


def _webp(picture: np.ndarray, lossless: bool) -> str:
    """``picture``, uint8 RGB (H, W, 3), as a data URI."""
    options = [cv2.IMWRITE_WEBP_QUALITY, _LOSSLESS if lossless else _QUALITY]
    done, content = cv2.imencode(".webp", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), options)
    if not done:
        raise RuntimeError("OpenCV cannot encode WebP")
    return _data_uri("webp", content.tobytes())


def svg_uri(svg: str) -> str:
    """SVG text as a data URI: as an image, a figure cannot clash with another's ids."""
    return _data_uri("svg+xml", svg.encode())


def _data_uri(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"

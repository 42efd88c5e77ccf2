"""The whole translator of keypoints."""

import numpy as np
import torch
from torch import Generator, Tensor, nn

from anyview.runtime.errors import AnyviewError
from anyview.translator.keypoints.codes import KEYPOINTS, WIDTH
from anyview.translator.keypoints.decoder import KeypointDecoder
from anyview.translator.keypoints.encoder import KeypointEncoder, Seen
from anyview.translator.keypoints.translation import KeypointTranslation

_STRIDE = 8


class KeypointTranslator(nn.Module):
    """The whole translator for square frames of ``image_size`` pixels.

    Raises ``AnyviewError`` for a size that is no multiple of 8.
    """

    architecture = "keypoint"
    relative = False
    width = WIDTH
    shared = True

    def __init__(self, image_size: int, task_embedding: bool = False):
        super().__init__()
        if image_size < _STRIDE or image_size % _STRIDE:
            raise AnyviewError(
                f"architecture {self.architecture}: image size {image_size} must be a multiple of {_STRIDE}"
            )
        self.image_size = image_size
        self.task_embedding = task_embedding
        self.encoder = KeypointEncoder()
        self.translation = KeypointTranslation(self.width, self.relative, task_embedding)
        self.decoder = KeypointDecoder()
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # a third faster

    def encode_expert(self, frames: Tensor, noise: Generator | None = None) -> Tensor:
        """z1 (N, width) of ``frames`` (N, 3, H, W) in [-1, 1]."""
        return self.encoder(frames).code

    def encode_context(self, frames: Tensor, noise: Generator | None = None) -> tuple[Tensor, list[Tensor]]:
        """z2 (N, width) of first frames (N, 3, H, W), and what the decoder needs beside codes."""
        return self.context_of(frames, self.encoder(frames))

    def context_of(self, frames: Tensor, seen: Seen) -> tuple[Tensor, list[Tensor]]:
        """What ``encode_context`` returns, of first frames (N, 3, H, W) and of what is ``seen`` in them."""
        return seen.code, [frames, seen.code, seen.map]

    def task_frames(self, length: int) -> np.ndarray:
        """Steps of a clip of ``length`` frames whose codes T is given beside the present one.

        The first; and with a task embedding the last, which tells where the task ends.
        """
        return np.array([0, length - 1] if self.task_embedding else [0])

    def summarise(self, codes: Tensor) -> Tensor:
        """What T is told of a clip, (N, F width), of the codes (N, F, width) of its ``task_frames``."""
        return codes.flatten(1)

    def translate(
        self, z1: Tensor, z2: Tensor, task: Tensor | None = None, noise: Generator | None = None
    ) -> Tensor:
        """T: z3 (N, width) of z1 (N, width), z2 (N or 1, width) and ``task``, what it is told of the clip."""
        assert task is not None
        told = [each.expand_as(z1) for each in task.split(self.width, dim=1)]
        return self.translation(z1, z2.expand_as(z1), *told)

    def features(self, z: Tensor) -> Tensor:
        """What of z (N, width) a reward compares: the places, (N, 2 K).

        How an arm looks where it is seen differs more from frame to frame than what a task is about.
        """
        return z[:, : 2 * KEYPOINTS]

    def expert_features(self, frames: Tensor) -> Tensor:
        """``features`` of the z1 of ``frames`` (N, 3, H, W), without what only the rest of z1 needs."""
        return self.encoder.places(frames)

    def decode(self, z: Tensor, skips: list[Tensor]) -> Tensor:
        """Dec: frames (N, 3, H, W) of z (N, width) and skips of C contexts, row n in context n modulo C."""
        return self.decoder(z, self.decoder.skip_terms(skips))


class RelativeKeypointTranslator(KeypointTranslator):
    """The same, whose T is told relative places: its first two keypoints must be taught what they are."""

    architecture = "keypoint-relative"
    relative = True

"""Translators by the name of their architecture, and what any of them is told of a clip."""

from typing import cast

from torch import Tensor

from anyview.runtime.errors import AnyviewError
from anyview.translator.keypoints.translator import KeypointTranslator, RelativeKeypointTranslator
from anyview.translator.network import ARCHITECTURES, ArchitectureName, ContextTranslator

Translator = ContextTranslator | KeypointTranslator

_OF_KEYPOINTS = {kind.architecture: kind for kind in (KeypointTranslator, RelativeKeypointTranslator)}


def make_translator(architecture: str, image_size: int, task_embedding: bool = False) -> Translator:
    """A new translator, whose T is told of the whole clip if ``task_embedding``.

    Raises AnyviewError for an unknown architecture, or a size that its strides do not divide.
    """
    if architecture in _OF_KEYPOINTS:
        return _OF_KEYPOINTS[architecture](image_size, task_embedding)
    if architecture not in ARCHITECTURES:
        known = ", ".join([*ARCHITECTURES, *_OF_KEYPOINTS])
        raise AnyviewError(f"architecture {architecture!r}: must be one of {known}")
    return ContextTranslator(cast(ArchitectureName, architecture), image_size, task_embedding)


def embed_task(model: Translator, z1: Tensor) -> Tensor | None:
    """What T is told of a clip, (1, ...), of the codes z1 (T, width) of all its frames; None if nothing."""
    steps = model.task_frames(len(z1))
    return model.summarise(z1[steps][None]) if len(steps) else None

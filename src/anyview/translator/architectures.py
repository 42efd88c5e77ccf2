"""Translators by the name of their architecture."""

from typing import cast

from anyview.runtime.errors import AnyviewError
from anyview.translator.keypoints import KeypointTranslator, RelativeKeypointTranslator
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

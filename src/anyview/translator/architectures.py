"""Translators by the name of their architecture."""

from typing import cast

from anyview.runtime.errors import AnyviewError
from anyview.translator.keypoints import KeypointTranslator
from anyview.translator.network import ARCHITECTURES, ArchitectureName, ContextTranslator

Translator = ContextTranslator | KeypointTranslator


def make_translator(architecture: str, image_size: int, task_embedding: bool = False) -> Translator:
    """A new translator. That of keypoints has a task embedding of its own, whatever ``task_embedding`` says.

    Raises AnyviewError for an unknown architecture, or a size that its strides do not divide.
    """
    if architecture == KeypointTranslator.architecture:
        return KeypointTranslator(image_size)
    if architecture not in ARCHITECTURES:
        known = ", ".join([*ARCHITECTURES, KeypointTranslator.architecture])
        raise AnyviewError(f"architecture {architecture!r}: must be one of {known}")
    return ContextTranslator(cast(ArchitectureName, architecture), image_size, task_embedding)

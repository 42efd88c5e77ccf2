"""Named random streams derived from ``base.seed``.

Every random number in the project comes from ``stream(seed, name, ...)``. Streams with different names or
indices are independent, so that adding a draw to one stage changes no other.
"""

import hashlib

import numpy as np


def _words(name: str) -> list[int]:
    digest = hashlib.sha256(name.encode()).digest()
    return [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]


def stream(seed: int, name: str, *indices: int) -> np.random.Generator:
    """Generator for the stream ``name`` (for example "evaluation"), item ``indices`` (for example a run)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, *_words(name), *indices])))


def torch_seed(seed: int, name: str, *indices: int) -> int:
    """A seed for ``torch.Generator.manual_seed``, from the same named streams."""
    return int(stream(seed, name, *indices).integers(2**62))

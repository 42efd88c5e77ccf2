"""Unit vectors from angles and angles from vectors, with the same last bit on every processor.

For real numbers, numpy's sine, cosine and arc tangent depend on the processor: with AVX-512 they are its own
and differ from the C library's in the last bit. For complex numbers numpy always calls the C library, whose
results are the same on every processor with AVX2.
"""

import numpy as np


def unit_vector(angle: np.ndarray | float) -> np.ndarray:
    """Unit vectors (..., 2), the cosine and sine of ``angle`` (...) in radians."""
    return np.exp(1j * np.asarray(angle)[..., None]).view(np.float64)


def angle_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Angles (...) in radians, in [-pi, pi], of the vectors with components ``x`` (...) and ``y`` (...).

    Not defined for the zero vector.
    """
    return np.log(x + 1j * y).imag

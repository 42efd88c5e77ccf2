"""Unit vectors from angles and angles from vectors, with the same last bit on every processor.

numpy has kernels of its own for the sine, cosine and arc tangent of real numbers. Which one runs depends on the
processor (AVX-512 has another than AVX2), and their last bits differ. Of complex numbers it lets the C library
compute, whose results are the same on every processor with AVX2.
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

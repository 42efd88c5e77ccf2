"""Unit vectors and angles against Python's own, one number at a time."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from anyview.trigonometry import angle_of, unit_vector

angles = st.lists(st.floats(-50, 50), min_size=1, max_size=20)
lengths = st.floats(1e-6, 1e3)


@given(angles)
def test_unit_vectors_have_every_bit_of_the_c_librarys(values: list[float]) -> None:
    expected = [[math.cos(value), math.sin(value)] for value in values]
    np.testing.assert_array_equal(unit_vector(np.array(values)), expected)
    np.testing.assert_array_equal(unit_vector(values[0]), expected[0])
    grid = np.array(values * 4).reshape(2, 2, -1)[:, ::-1]
    np.testing.assert_array_equal(unit_vector(grid)[1, 0], expected)


@given(st.floats(-3.1, 3.1), lengths)
def test_an_angle_is_found_again_with_every_bit_of_the_c_librarys(angle: float, length: float) -> None:
    x, y = length * math.cos(angle), length * math.sin(angle)
    np.testing.assert_array_equal(angle_of(np.array([x]), np.array([y])), [math.atan2(y, x)])
    np.testing.assert_allclose(angle_of(np.array([x]), np.array([y])), [angle], atol=1e-14)

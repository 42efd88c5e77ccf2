"""Pixels as networks see them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from anyview.video.pixels import to_frames, to_input


@given(arrays(np.uint8, (2, 4, 4, 3), elements=st.integers(0, 255)))
def test_frames_survive_the_way_to_the_network_and_back(frames):
    pixels = to_input(frames)
    assert pixels.shape == (2, 3, 4, 4)
    assert pixels.abs().max() <= 1
    assert np.array_equal(to_frames(pixels), frames)

"""Even exposure: what stands still looks as in the first frame, whatever moves in front of it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from anyview.ingest.exposure import even_exposure
from anyview.ingest.normalize import read_clip
from anyview.seeds import stream
from tests.ingest.raw_clips import LIMITS, pictures, write_raw

GAIN = st.floats(0.8, 1.2)


def scene(seed: int, count: int, moving: float) -> tuple[np.ndarray, np.ndarray]:
    """Light (T, 48, 48, 3) of a mottled table, something crossing its left; and where that was (48, 48)."""
    rng = stream(seed, "exposure test")
    light = np.repeat(rng.uniform(40, 190, (1, 48, 48, 3)), count, axis=0)
    width, touched = round(48 * moving), np.zeros((48, 48), bool)
    for index, left in enumerate(rng.integers(0, 20 - width, count)):
        light[index, :, left : left + width] = rng.uniform(20, 200, 3)
        touched[:, left : left + width] = True
    return light, touched


@settings(max_examples=30)
@given(
    seed=st.integers(0, 1000),
    moving=st.floats(0.1, 0.25),
    gains=st.lists(st.tuples(GAIN, GAIN, GAIN), min_size=3),
)
def test_what_stands_still_looks_as_at_first(seed, moving, gains):
    light, touched = scene(seed, len(gains) + 1, moving)
    exposed = light * np.array([(1, 1, 1), *gains])[:, None, None]
    seen = np.clip(np.rint(exposed + stream(seed, "noise").normal(0, 1.0, exposed.shape)), 0, 255).astype(
        np.uint8
    )
    evened = even_exposure(seen)
    still = ~touched  # the greater part of a picture
    before, after = (clip[:, still].astype(float).mean(axis=1) for clip in (seen, evened))
    np.testing.assert_allclose(after, np.broadcast_to(after[0], after.shape), atol=1.0)
    np.testing.assert_array_equal(evened[0], seen[0])
    assert np.abs(after - after[0]).max() <= np.abs(before - before[0]).max() + 0.5
    # What moves is scaled likewise: as the light of the scene says, under the first frame's exposure.
    np.testing.assert_allclose(evened.astype(float), light, atol=8.0)


def test_a_clip_of_even_exposure_stays_as_it_is():
    light, _ = scene(5, 12, 0.2)
    seen = light.astype(np.uint8)
    np.testing.assert_allclose(even_exposure(seen).astype(int), seen, atol=1)


def test_frames_in_which_a_gain_explains_nothing_stay_as_they_are():
    frames = np.stack([np.full((48, 48, 3), level, np.uint8) for level in (120, 0, 255)])
    np.testing.assert_array_equal(even_exposure(frames), frames)


def test_ingest_evens_the_exposure_if_params_ask_for_it(tmp_path):
    fading = np.linspace(1.0, 0.8, 82)[:, None, None, None] * pictures()
    path = write_raw(tmp_path / "clip.avi", fading.astype(np.uint8))
    corners = {
        wanted: read_clip(path, LIMITS.model_copy(update={"even_exposure": wanted}))[:, :12].mean(
            axis=(1, 2, 3)
        )
        for wanted in (False, True)
    }
    assert corners[False][-1] < 0.85 * corners[False][0]
    np.testing.assert_allclose(corners[True], corners[True][0], rtol=0.015)

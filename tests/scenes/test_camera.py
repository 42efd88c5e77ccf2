"""Lenses bend as they say, and sensors keep the picture."""

import numpy as np
import pytest

from anyview.scenes.camera import Lens, Sensor
from anyview.seeds import stream


@pytest.mark.parametrize("k", [-0.03, 0.0, 0.08, 0.16])
def test_a_lens_keeps_the_corners_and_its_two_directions_agree(k):
    points = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 2), axis=-1).reshape(-1, 2)
    lens = Lens(k)
    np.testing.assert_allclose(lens.drawn(np.array([[1.0, -1.0]])), [[1.0, -1.0]])
    np.testing.assert_allclose(lens.seen(lens.drawn(points)), points, atol=2e-3)
    inwards = np.linalg.norm(lens.drawn(0.5 * points), axis=1) <= np.linalg.norm(0.5 * points, axis=1) + 1e-12
    assert inwards.all() == (k >= 0)  # barrel: the middle is enlarged


@pytest.mark.parametrize("seed", range(12))
def test_a_sensor_keeps_what_is_where_and_its_exposure(seed):
    drawn = np.full((192, 192, 3), 60, np.uint8)
    drawn[40:80, 100:160] = (220, 40, 40)
    rng = stream(seed, "test sensor")
    lens = Lens(rng.uniform(-0.03, 0.16))
    sensor = Sensor(rng, lens, 192, 48)
    frames = np.stack([sensor.expose(drawn) for _ in range(6)])
    assert frames.shape == (6, 48, 48, 3)
    redness = frames[0, ..., 0].astype(int) - frames[0, ..., 1]
    y, x = np.nonzero(redness > redness.max() / 2)
    expected = lens.seen(np.array([[129.5, 59.5]]) / 96 - 1)[0] * 24 + 23.5
    np.testing.assert_allclose([x.mean(), y.mean()], expected, atol=1.2)
    levels = frames.mean(axis=(1, 2, 3))
    assert np.abs(levels / levels[0] - 1).max() < 0.12

"""The studio draws what it is given, where its cameras say."""

import numpy as np
import pytest

from anyview.scenes.camera import place_camera
from anyview.scenes.shapes import (
    UPRIGHT,
    Surface,
    apply,
    box,
    capsule,
    compose,
    cylinder,
    moved,
    pitch,
    yaw,
    z_along,
)
from anyview.scenes.studio import Light, studio

RED = Surface((1.0, 0.0, 0.0), casts_shadow=False)
SUN = Light(np.array([0.3, 0.2, 2.0]), (0.6,) * 3, (0.4,) * 3, 0.0, None, 0.0, casts_shadow=True)


def cameras():
    return [
        place_camera(azimuth, elevation, roll, field, np.array([0.02, -0.01, 0.0]), distance)
        for azimuth, elevation, roll, field, distance in [
            (0.4, 0.8, 0.1, 0.6, 1.1),
            (2.6, 0.5, -0.2, 1.0, 0.8),
        ]
    ]


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.02), (0.12, -0.08, 0.05), (-0.15, 0.1, 0.0)])
def test_a_shape_is_drawn_where_the_cameras_project_it(place):
    views = cameras()
    studio(192).arrange([], [SUN], views, [])
    pictures = studio(192).shoot([box((0.01, 0.01, 0.01), place, RED)])
    for view, picture in zip(views, pictures, strict=True):
        y, x = np.nonzero(picture[..., 0] > 60)
        assert len(x) > 10
        expected = (view.project(np.array([place]))[0] + 1) * 96 - 0.5
        np.testing.assert_allclose([x.mean(), y.mean()], expected, atol=1.0)


def test_what_stood_in_the_last_scene_is_gone():
    studio(192).arrange([box((0.1, 0.1, 0.1), (0, 0, 0), RED)], [SUN], cameras(), [])
    assert studio(192).shoot([]).any()
    studio(192).arrange([], [SUN], cameras(), [])
    assert not studio(192).shoot([]).any()


def test_a_shadow_darkens_the_table():
    table = box((0.5, 0.5, 0.01), (0, 0, -0.01), Surface((0.8, 0.8, 0.8), casts_shadow=False))
    ball = cylinder(0.06, 0.02, (0, 0, 0.3), Surface((0.8, 0.8, 0.8)))
    studio(192).arrange([table], [SUN], cameras(), [])
    bare, shaded = studio(192).shoot([]).astype(int), studio(192).shoot([ball]).astype(int)
    assert (shaded < bare - 40).any(axis=3).mean() > 0.005


def test_bodies_turn_and_move_as_one():
    turn = compose(yaw(0.7), pitch(-0.4))
    np.testing.assert_allclose(turn, yaw(0.7) @ pitch(-0.4), atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, UPRIGHT, atol=1e-12)
    np.testing.assert_allclose(apply(turn, np.array([1.0, 2.0, 3.0])), turn @ [1.0, 2.0, 3.0])
    begin, end = np.array([0.1, 0.0, 0.2]), np.array([0.3, 0.1, 0.0])
    (rod,) = moved([capsule(begin, end, 0.01, RED)], (1, 0, 0), turn)
    axis = rod.turn @ [0, 0, rod.size[1]]
    np.testing.assert_allclose(rod.position + axis, turn @ end + [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(rod.position - axis, turn @ begin + [1, 0, 0], atol=1e-12)
    for direction in ([0.0, 0.0, -2.0], [0.0, 3.0, 0.0], [1.0, -1.0, 0.5]):
        turn = z_along(np.array(direction))
        np.testing.assert_allclose(
            turn @ [0, 0, 1], np.array(direction) / np.linalg.norm(direction), atol=1e-12
        )
        assert np.linalg.det(turn) == pytest.approx(1.0)


@pytest.mark.parametrize("field", ["category", "objtype", "objid", "segid", "transparent", "camdist"])
def test_a_picture_does_not_depend_on_what_memory_held(field):
    """MuJoCo leaves these fields of a new shape as they were; a decoration (category 4) has no shadow."""
    table = box((0.5, 0.5, 0.01), (0, 0, -0.01), Surface((0.8, 0.8, 0.8), casts_shadow=False))
    ball = capsule((0, 0, 0.02), (0.1, 0, 0.1), 0.03, Surface((0.8, 0.2, 0.2)))
    pictures = []
    for held in (0, 1, 4):
        for geom in studio(192)._scene.geoms[:2]:
            setattr(geom, field, held)
        studio(192).arrange([table], [SUN], cameras(), [])
        pictures.append(studio(192).shoot([ball]))
    np.testing.assert_array_equal(pictures[1:], [pictures[0]] * 2)

"""Random scenes: the rig's task in them, and nothing else of the rig."""

import colorsys
import math
import os
import subprocess
import sys

import cv2
import numpy as np
import pandas as pd
import pytest

from anyview.scenes import looks
from anyview.scenes.camera import View
from anyview.scenes.demonstrations import DURATION, MARKS, Demonstration, render_demonstration
from anyview.scenes.operator import sample_operator
from anyview.scenes.shapes import Shape
from anyview.scenes.tabletop import sample_object, sample_room, sample_target, sample_things
from anyview.seeds import stream
from anyview.surrogate import scene as rig
from anyview.surrogate.film import _LENSES
from anyview.surrogate.push import Push, sample_push
from anyview.surrogate.textures import texture_files
from anyview.surrogate.things import THING_COLOURS
from anyview.video.datasets import clip_pairs, open_dataset
from anyview.video.places import find_object
from tests.long_stages import change, digests
from tests.test_structure import SOURCE, reached_from

SEEDS = range(16)


@pytest.fixture(scope="module")
def demonstrations() -> list[Demonstration]:
    return [render_demonstration(stream(seed, "test scenes"), 4, 48) for seed in SEEDS]


def seen(view: View, xy: np.ndarray, height: float = 0.02) -> np.ndarray:
    """Pixels (N, 2), x and y, of places (N, 2) on the table in a frame of 48 x 48: by OpenCV's pinhole."""
    camera = view.camera
    rotation = np.stack([np.cross(camera.forward, camera.up), -camera.up, camera.forward])
    focal = 24 / np.tan(camera.field / 2)
    points = np.column_stack([xy, np.full(len(xy), height)])
    matrix = np.array([[focal, 0, 23.5], [0, focal, 23.5], [0, 0, 1]])
    turned = cv2.Rodrigues(rotation)[0], -rotation @ camera.position
    drawn = cv2.projectPoints(points, *turned, matrix, None)[0][:, 0]
    return view.lens.seen((drawn - 23.5) / 24) * 24 + 23.5


def test_both_views_show_the_push_at_the_same_moments(demonstrations):
    """Where the object has come to, the picture has changed: in both views, and not before it came."""
    changes: dict[str, list[float]] = {"object": [], "elsewhere": []}
    for shot in demonstrations:
        assert shot.clips.shape == (2, 5, 48, 48, 3)
        assert shot.times[0] == 0
        assert (np.diff(shot.times) > 0).all()
        assert shot.times[-1] <= DURATION
        for view, clip in zip(shot.views, shot.clips, strict=True):
            where = seen(view, np.stack([shot.push.at(time)[1] for time in shot.times])).round().astype(int)
            gone = np.linalg.norm(where - where[0], axis=1) > 8
            for frame, (x, y) in zip(clip[gone], where[gone], strict=True):
                change_ = np.abs(frame.astype(int) - clip[0]).mean(axis=2)
                changes["object"].append(change_[y - 1 : y + 2, x - 1 : x + 2].mean())
                changes["elsewhere"].append(np.median(change_))
    assert len(changes["object"]) > 20
    assert np.median(changes["object"]) > 8 * np.median(changes["elsewhere"])
    assert np.mean(np.array(changes["object"]) > 2 * np.array(changes["elsewhere"])) > 0.9


def test_marks_are_where_things_are(demonstrations):
    """Object, target and tool by OpenCV's pinhole; and where the object is blue, its pixels say the same."""
    gaps = []
    for shot in demonstrations:
        for view, clip, marks in zip(shot.views, shot.clips, shot.marks, strict=True):
            cups, objects = (np.stack(part) for part in zip(*map(shot.push.at, shot.times), strict=True))
            places = {name: marks[:, index] for index, name in enumerate(MARKS)}
            np.testing.assert_allclose(places["object"], seen(view, objects), atol=0.01)
            np.testing.assert_allclose(
                places["target"][:1], seen(view, shot.push.target_xy[None], 0.0), atol=0.01
            )
            low = cups[:, 2].argmin()  # the tool where it touches the table
            height = cups[low, 2] + 0.02
            np.testing.assert_allclose(
                places["tool"][low], seen(view, cups[low : low + 1, :2], height)[0], atol=0.01
            )
            for frame, place in zip(clip, places["object"], strict=True):
                x, y = place.round().astype(int)
                red, green, blue = frame[y, x].astype(int)
                if blue > 60 and blue > 1.6 * max(red, green):  # a blue one, and nothing before it
                    gaps.append(math.dist(find_object(frame), place))
    assert len(gaps) > 30
    assert np.median(gaps) < 1.2


def test_beside_a_blue_object_nothing_else_is_blue():
    for seed in range(60):
        rng = stream(seed, "blue")
        push = sample_push(rng)
        things = sample_things(rng, push, (0.05, 0.1, 0.9))
        hues = [colorsys.rgb_to_hsv(*thing.surface.colour) for thing in things]
        assert not any(0.52 < hue < 0.72 and vivid > 0.5 and bright > 0.25 for hue, vivid, bright in hues)


def test_object_and_target_stay_inside_both_pictures(demonstrations):
    for shot in demonstrations:
        for view in shot.views:
            places = seen(view, np.concatenate([shot.push.object_xy, shot.push.target_xy[None]]))
            assert ((places > 1) & (places < 46)).all()


def test_a_scene_does_not_depend_on_those_before_it(demonstrations):
    again = render_demonstration(stream(SEEDS[3], "test scenes"), 4, 48)
    np.testing.assert_array_equal(again.clips, demonstrations[3].clips)


def test_scenes_differ_widely(demonstrations):
    """Their mean colours, and their brightness, spread over a good part of what pictures can be."""
    means = np.stack([clip[0].mean(axis=(0, 1)) for shot in demonstrations for clip in shot.clips])
    assert (means.std(axis=0) > 20).all()
    assert means.mean(axis=1).min() < 90
    assert means.mean(axis=1).max() > 150


def test_only_the_motion_is_the_rigs():
    """Of the rig's code, nothing but how a demonstration and an arm move."""
    reached = {file for path in (SOURCE / "anyview/scenes").glob("*.py") for file in reached_from(path)}
    of_the_rig = {file for file in reached if "/surrogate/" in file and not file.endswith("__init__.py")}
    assert of_the_rig == {"src/anyview/surrogate/push.py", "src/anyview/surrogate/arm.py"}


def test_no_look_and_no_demonstration_of_the_rig_is_in_a_scene(demonstrations):
    colours, pictures = [], []
    for seed in range(100):
        rng = stream(seed, "test looks")
        push = sample_push(rng)
        colours += [shape.surface.colour for shape in shapes(rng, push)]
        pictures.append(looks.texture(rng, looks.table_colour(rng)))
    plain = [(1.0, 1.0, 1.0)]  # of what has a texture
    drawn = np.array([colour for colour in colours if colour not in plain])
    tables = (rig.OTHER_TARGET_COLOURS, rig._SLEEVES, rig._SKINS, THING_COLOURS)
    taken = np.array(
        [rig.OBJECT_COLOUR, rig.TARGET_COLOUR, *(colour for table in tables for colour in table)]
    )
    assert len(drawn) > 3000
    assert np.abs(drawn[:, None] - taken).max(axis=2).min() > 1e-4
    for data in texture_files().values():
        theirs = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        theirs = cv2.resize(theirs, (256, 256), interpolation=cv2.INTER_AREA)
        assert max(alike(theirs, ours) for ours in pictures) < 0.8
    fields = {view.camera.field for shot in demonstrations for view in shot.views}
    assert fields.isdisjoint(fovy for fovy, _, _ in _LENSES.values())
    theirs = [sample_push(stream(42, "film", index)).target_xy for index in range(77)]
    ours = [sample_push(stream(42, "scenes", number)).target_xy for number in range(100)]
    assert np.abs(np.array(ours)[:, None] - theirs).max(axis=2).min() > 1e-6


def shapes(rng: np.random.Generator, push: Push) -> list[Shape]:
    """All that stands or moves in a random scene."""
    table = looks.table_colour(rng)
    thing = sample_object(rng, table)
    return [
        *thing,
        *sample_operator(rng).posed(push.cup[0]),
        *sample_room(rng, table, [0.0, 2.0]),
        *sample_target(rng, push, table, thing[0].surface.colour),
        *sample_things(rng, push, thing[0].surface.colour),
    ]


def alike(first: np.ndarray, second: np.ndarray) -> float:
    """Correlation of two pictures' grey patterns."""
    patterns = [picture.mean(axis=2).ravel() for picture in (first, second)]
    return abs(float(np.corrcoef(*patterns)[0, 1])) if all(p.std() > 0 for p in patterns) else 0.0


def test_one_worker_or_two_make_the_same_set_of_pairs(root, tmp_path, monkeypatch):
    small = {"real.render.demonstrations": 23, "real.render.moments": 1, "split.rendered.validation": 4}
    made = {}
    for workers in ("1", "2"):
        (folder := tmp_path / workers).mkdir()
        (folder / "params.yaml").write_bytes((root / "params.yaml").read_bytes())
        change(folder, small)
        environment = {
            "PYTHONPATH": str(root / "src"),
            "ANYVIEW_SCRATCH": str(tmp_path / f"scratch-{workers}"),
        }
        for command in (["render.py"], ["split.py", "rendered"]):
            subprocess.run(
                [sys.executable, root / "stages" / command[0], *command[1:]],
                cwd=folder,
                env=os.environ | environment | {"ANYVIEW_WORKERS": workers},
                check=True,
            )
        made[workers] = digests(folder / "data")
    assert made["1"] == made["2"]
    monkeypatch.chdir(tmp_path / "2")
    dataset = open_dataset("rendered")
    assert dataset.frames.shape == (46, 2, 48, 48, 3)
    assert dataset.marks.shape == (46, 2, len(MARKS), 2)
    assert len(dataset.split("validation")) == 4  # whole pairs
    for source, target in clip_pairs(dataset, "validation"):
        assert source != target
        assert dataset.clips["pair"].iloc[source] == dataset.clips["pair"].iloc[target]
    times = pd.read_csv("data/clips/rendered/manifest.csv").groupby("pair")["times"]
    assert (times.nunique() == 1).all()
    assert times.first().nunique() > 20  # two of them may fall on the same hundredth of a second

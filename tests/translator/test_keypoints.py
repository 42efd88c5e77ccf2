"""The translator of keypoints: places are found, moved and drawn."""

from dataclasses import replace
from itertools import pairwise

import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given, settings

from anyview.runtime.errors import AnyviewError
from anyview.seeds import stream
from anyview.training.augmentation import mirror
from anyview.training.common.fit import fit
from anyview.training.translator import TranslatorObjective
from anyview.translator.architectures import embed_task, make_translator
from anyview.translator.keypoints.codes import KEYPOINTS, draw_strokes, with_places
from anyview.translator.keypoints.decoder import _carry
from anyview.translator.keypoints.encoder import Seen, finding_loss, place_loss
from anyview.translator.keypoints.translation import _ends, relative_places
from anyview.translator.keypoints.translator import KeypointTranslator, RelativeKeypointTranslator
from anyview.translator.losses import Marks
from anyview.translator.weights import load_translator, save_translator
from anyview.video.marks import write_marks
from anyview.video.pixels import to_input
from tests.training.discworld import SIZE, disc_marks


@pytest.fixture(params=[KeypointTranslator, RelativeKeypointTranslator])
def model(request) -> KeypointTranslator:
    torch.manual_seed(3)
    return request.param(16).eval()


def frames(count: int, size: int = 16) -> torch.Tensor:
    return torch.rand(count, 3, size, size, generator=torch.Generator().manual_seed(5)) * 2 - 1


def test_features_of_frames_are_those_of_their_codes(model):
    frames = to_input(torch.randint(0, 256, (3, 16, 16, 3), dtype=torch.uint8))
    with torch.no_grad():
        found = model.expert_features(frames)
        assert found.shape == (3, 2 * KEYPOINTS)
        torch.testing.assert_close(found, model.features(model.encode_expert(frames)), rtol=0, atol=1e-6)


def test_one_context_serves_a_clip_and_several_serve_in_turn(model):
    contexts, clip = frames(2), frames(6)
    with torch.no_grad():
        z1 = model.encode_expert(clip)
        z2, skips = model.encode_context(contexts)
        z3 = model.translate(z1, z2.repeat(3, 1), embed_task(model, z1))
        both = model.decode(z3, skips)
        for row in range(6):
            alone_z2, alone = model.encode_context(contexts[row % 2 : row % 2 + 1])
            alone_z3 = model.translate(z1[row : row + 1], alone_z2, embed_task(model, z1))
            torch.testing.assert_close(model.decode(alone_z3, alone)[0], both[row], atol=1e-4, rtol=1e-4)


def test_at_first_the_context_is_copied_more_than_painted_over(model):
    contexts = frames(4)
    with torch.no_grad():
        z2, skips = model.encode_context(contexts)
        made = model.decode(z2, skips)
    noise = contexts.flip(0)
    assert (made - contexts).square().mean() < 0.3 * (noise - contexts).square().mean()


@settings(max_examples=15)
@given(hnp.arrays(np.float32, (1, KEYPOINTS, 2), elements=st.floats(-1.25, 1.25, width=32)))
def test_strokes_are_gaussians_around_places_and_lines(places):
    """Against the distance of each pixel's centre from a point, or from a dense row of points."""
    made = draw_strokes(torch.from_numpy(places), torch.zeros(1, 1, 12, 12))[0].numpy()
    centres = (2 * np.arange(12) + 1) / 12 - 1
    pixels = np.stack(np.meshgrid(centres, centres), -1)
    lines = [a + (b - a) * np.linspace(0, 1, 400)[:, None] for a, b in pairwise(places[0])]
    for points, stroke in zip([*places[0][:, None], *lines], made, strict=True):
        gap = np.linalg.norm(pixels[:, :, None] - points, axis=-1).min(axis=-1) * 6  # in pixels of the map
        np.testing.assert_allclose(stroke, np.exp(-(gap**2) / 2), atol=0.01)


@settings(max_examples=20)
@given(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), st.integers(0, 3))
def test_the_first_frame_is_shifted_with_the_object_and_turned_with_tool_and_arm(step, quarters):
    """Against pixels moved one by one: whole steps, and quarter turns about a pixel's centre."""
    first = frames(1)
    before = np.zeros((1, KEYPOINTS, 2), int)  # pixels
    before[0, [0, 2, 3, 4]] = [(8, 7), (8, 7), (8, 10), (11, 10)]  # object; tool, wrist and elbow
    turn = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), quarters)
    now = before.copy()
    now[0, [0, 2]] += step
    for joint, end in ((3, 2), (4, 3)):  # each line turns, from the tool on
        now[0, joint] = now[0, end] + turn @ (before[0, joint] - before[0, end])
    shifted, *turned = _carry(first, *(torch.from_numpy((2 * at + 1) / 16 - 1) for at in (before, now)))[0]
    for picture, point, rotation in (
        (shifted, 0, np.eye(2, dtype=int)),
        (turned[0], 2, turn),
        (turned[1], 3, turn),
    ):
        for x, y in np.ndindex(16, 16):
            source = before[0, point] + rotation.T @ ((x, y) - now[0, point])
            if ((source >= 0) & (source < 16)).all():
                wanted = first[0, :, source[1], source[0]]
                torch.testing.assert_close(picture[:, y, x], wanted, atol=1e-4, rtol=0)


def test_dec_draws_at_marks_where_they_are_known(model):
    codes = torch.linspace(-0.5, 0.5, 2 * model.width).reshape(2, -1)
    marks = torch.tensor([[[0.25, -0.5], [torch.nan, torch.nan]], [[3.0, 0.0], [0.5, 0.25]]])
    placed = with_places(codes, marks)
    assert placed[:, :4].tolist() == [
        [0.25, -0.5, *codes[0, 2:4].tolist()],
        [pytest.approx(1.1), 0.0, 0.5, 0.25],  # far outside counts as just outside
    ]
    assert torch.equal(placed[:, 4:], codes[:, 4:])


@settings(max_examples=30)
@given(hnp.arrays(np.float32, (4, 3, 2), elements=st.floats(-1, 1, width=32)))
def test_the_loss_of_places_is_their_mean_squared_distance(marks):
    places = np.linspace(-0.9, 0.9, 4 * 2 * KEYPOINTS, dtype=np.float32).reshape(4, KEYPOINTS, 2)
    codes = torch.from_numpy(np.concatenate((places.reshape(4, -1), np.ones((4, 32), np.float32)), 1))
    expected = np.mean([np.sum((places[n, m] - marks[n, m]) ** 2) for n in range(4) for m in range(3)])
    assert float(place_loss(codes, torch.from_numpy(marks))) == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_a_mark_that_is_not_known_costs_nothing_and_pulls_at_nothing():
    codes = torch.zeros(2, 2 * KEYPOINTS + 32, requires_grad=True)
    marks = torch.tensor([[[0.5, 0.0], [torch.nan, torch.nan]], [[torch.nan, torch.nan], [0.0, 0.2]]])
    loss = place_loss(codes, marks)
    loss.backward()
    assert loss.item() == pytest.approx((0.5**2 + 0.2**2) / 4)
    assert torch.nonzero(codes.grad).tolist() == [[0, 0], [1, 3]]


@settings(max_examples=20)
@given(hnp.arrays(np.float32, (2, 2, 2), elements=st.floats(-1.25, 1.25, width=32)))
def test_finding_costs_cross_entropy_with_gaussians_beside_the_places(marks):
    """Pixel by pixel, in maps of 6 by 6; of a mark that is not known there is no loss."""
    marks[1, 1] = np.nan
    rng = np.random.default_rng(4)
    logits = rng.normal(size=(2, KEYPOINTS, 36)).astype(np.float32)
    codes = torch.from_numpy(rng.uniform(-1, 1, (2, 2 * KEYPOINTS + 32)).astype(np.float32))
    seen = Seen(codes, torch.zeros(2, 16, 6, 6), torch.from_numpy(logits))
    entropies = []
    for n, m in ((0, 0), (0, 1), (1, 0)):
        x, y = (marks[n, m].clip(-5 / 6, 5 / 6) + 1) * 3 - 0.5  # pixels of the map, at its edge if outside
        wanted = np.array([np.exp(-((c - x) ** 2 + (r - y) ** 2) / 2) for r in range(6) for c in range(6)])
        told = np.exp(logits[n, m]) / np.exp(logits[n, m]).sum()
        entropies.append(-(wanted / wanted.sum() * np.log(told)).sum())
    expected = float(place_loss(codes, torch.from_numpy(marks))) + 0.02 * np.sum(entropies) / 4
    assert float(finding_loss(seen, torch.from_numpy(marks))) == pytest.approx(expected, rel=1e-4)


@settings(max_examples=20)
@given(st.integers(0, 1000), hnp.arrays(int, (9, 2), elements=st.integers(0, 15)))
def test_marks_are_mirrored_with_their_pictures(seed, pixels):
    """A white pixel at each mark is still at it afterwards, whichever clips were mirrored."""
    pictures = torch.zeros(9, 3, 16, 16)
    for picture, (x, y) in zip(pictures, pixels, strict=True):
        picture[:, y, x] = 1
    marks = torch.from_numpy((2 * pixels[:, None] + 1) / 16 - 1).float()
    made = mirror(
        pictures[:6], pictures[6:], pictures[:3, None], Marks(marks[:6], marks[6:]), stream(seed, "x")
    )
    paired, context, clip, (paired_marks, context_marks) = made
    for picture, mark in zip(
        torch.cat((paired, context)), torch.cat((paired_marks, context_marks)), strict=True
    ):
        x, y = ((mark[0] + 1) * 8 - 0.5).round().int().tolist()
        assert picture[0, y, x] == 1
    assert torch.equal(clip[:, 0], paired[:3])


def test_it_learns_where_things_go_and_draws_them_there(make_objective, discs, pipeline):
    """On held-out clips the disc's keypoint ends up where the disc does, and the picture follows."""
    marked = replace(discs, marks=disc_marks(len(discs.frames)))
    write_marks(pipeline / "data/clips/diverse", marked.marks)
    small = make_objective(
        architecture="keypoint",
        weights={"reconstruction": 0.0, "alignment": 0.0},
        mirror=True,
        iterations=240,
        validation_every=240,
        batch_size=16,
        learning_rate=0.003,
        schedule="cosine",
    )
    weights = small.cell.weights.model_copy(update={"places": 1.0})
    cell = small.cell.model_copy(update={"weights": weights})
    fit("discs", TranslatorObjective(cell, small.training, 1, marked), pipeline / "model")
    model = load_translator(pipeline / "model")
    source, *targets = discs.split("validation")
    off, copied, lost = [], [], []
    with torch.no_grad():
        z1 = model.encode_expert(to_input(discs.frames[source]))
        for target in targets:
            true = to_input(discs.frames[target])
            z2, skips = model.encode_context(true[:1])
            z3 = model.translate(z1, z2, embed_task(model, z1))
            found = ((z3[:, :2] + 1) * SIZE / 2 - 0.5).numpy()
            place = marked.marks[target, :, 0]
            off.append(np.linalg.norm(found - place, axis=1).mean())
            copied.append(np.linalg.norm(place[0] - place, axis=1).mean())
            made = model.decode(z3, skips)
            lost.append(float((made - true).square().mean() / (true[:1] - true).square().mean()))
    assert np.mean(off) < 0.5 * np.mean(copied)
    assert np.mean(lost) < 0.8


@given(
    turn=st.floats(-3, 3),
    scale=st.floats(0.5, 1.5),
    shift=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    part=st.floats(0, 1),
)
def test_relative_places_are_the_same_however_the_picture_is_turned(turn, scale, shift, part):
    """And a keypoint that has gone part of the way from the first to the second is there."""
    rng = np.random.default_rng(0)
    first = np.array([[-0.4, 0.1], [0.3, 0.4], *rng.uniform(-0.5, 0.5, (KEYPOINTS - 2, 2))])
    now = first + rng.uniform(-0.2, 0.2, first.shape)
    now[0] = first[0] + part * (first[1] - first[0])

    def seen(places: np.ndarray) -> torch.Tensor:
        turned = places @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        return torch.from_numpy(np.append(scale * turned + shift, np.zeros(32))[None])

    found = relative_places(seen(now), seen(first))
    plain = relative_places(*(torch.from_numpy(np.append(each, np.zeros(32))[None]) for each in (now, first)))
    torch.testing.assert_close(found, plain)
    torch.testing.assert_close(found[0, :2], torch.tensor([part, 0.0], dtype=torch.float64))


@given(part=st.floats(0, 1), goal=st.integers(1, KEYPOINTS - 1))
def test_told_the_end_t_measures_the_way_to_the_keypoint_where_the_first_one_ends(part: float, goal: int):
    """Whichever that is: of goals that look alike, the expert's last frame tells which one counts."""
    places = np.stack(np.meshgrid([-0.8, -0.3, 0.3, 0.8], [-0.4, 0.4]), -1).reshape(-1, 2)
    now, last = places.copy(), places.copy()
    now[0] += part * (places[goal] - places[0])
    last[0] = places[goal]
    first, shown, ended = (
        torch.from_numpy(np.append(each, np.zeros(32))[None]) for each in (places, now, last)
    )
    ends = _ends(first, ended, torch.zeros(KEYPOINTS))
    assert ends[0, 0, goal] > 0.98
    along, beside = relative_places(shown, first, ends)[0, :2].tolist()
    assert along == pytest.approx(part, abs=0.03)
    assert beside == pytest.approx(0, abs=0.03)


@pytest.mark.parametrize("architecture", ["keypoint", "keypoint-relative"])
@pytest.mark.parametrize("task_embedding", [False, True])
def test_the_last_frame_tells_t_something_only_with_a_task_embedding(
    tmp_path, architecture: str, task_embedding: bool
):
    torch.manual_seed(1)
    save_translator(tmp_path, make_translator(architecture, 16, task_embedding), {})
    model = load_translator(tmp_path)
    clip, context = frames(5), frames(1)
    other = torch.cat((clip[:4], -clip[4:]))
    with torch.no_grad():
        z2, _ = model.encode_context(context)
        made = [
            model.translate(z1, z2, embed_task(model, z1))[:4]
            for z1 in map(model.encode_expert, (clip, other))
        ]
    assert torch.equal(*made) != task_embedding


def test_relative_places_are_finite_where_object_and_target_are_one():
    code = torch.full((1, 48), 0.2, requires_grad=True)
    relative_places(code, code).sum().backward()
    assert code.grad.isfinite().all()


def test_an_impossible_size_is_refused():
    with pytest.raises(AnyviewError, match=r"keypoint: .* multiple of 8"):
        KeypointTranslator(20)

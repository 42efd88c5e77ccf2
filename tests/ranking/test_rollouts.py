"""Scripted rollouts: each kind does what its name says."""

import numpy as np
import pytest

from anyview.pusher.contexts import Kind, sample_contexts
from anyview.ranking.rollouts import final_distances, scripted_rollouts
from anyview.seeds import stream


@pytest.mark.parametrize("kind", ["diverse", "choice"])
def test_good_ones_succeed_and_the_others_fail_in_their_way(kind: Kind):
    contexts, _ = sample_contexts(stream(0, "test"), 6, kind)
    rollouts = scripted_rollouts(contexts, 3, stream(0, "test rollouts"))
    arm, object_xy = (
        {name: each[..., part] for name, each in rollouts.items()} for part in (np.s_[:3], np.s_[3:])
    )
    start = np.array([context.object_xy for context in contexts])[:, None]
    goal = np.array([context.goal_xy for context in contexts])[:, None]
    assert {name: each.shape[:3] for name, each in rollouts.items()} == {
        name: (6, 1 if name == "still" else 3, 50) for name in rollouts
    }
    ends = {name: each[:, :, -1] for name, each in object_xy.items()}
    away = {name: np.linalg.norm(end - goal, axis=-1) for name, end in ends.items()}
    assert (away["good"] < 0.016).all()
    assert len(np.unique(away["good"])) == 18  # no two alike
    for name, each in away.items():
        np.testing.assert_allclose(final_distances(contexts, rollouts[name]), each)
        assert name == "good" or (each > 0.02).all(), name

    assert (np.ptp(rollouts["still"], axis=2) == 0).all()
    np.testing.assert_array_equal(arm["left_behind"], arm["good"])
    assert (object_xy["left_behind"] == start[:, :, None]).all()

    assert ((away["wrong_place"] >= 0.05) & (away["wrong_place"] < 0.31)).all()
    moved = np.linalg.norm(ends["wrong_place"] - start, axis=-1)
    assert (moved > 0.1).mean() > 0.9

    whole = np.linalg.norm(ends["good"] - start, axis=-1)
    part = np.linalg.norm(ends["stopped"] - start, axis=-1) / whole
    assert ((part > 0.05) & (part < 0.95)).all()
    assert (np.ptp(rollouts["stopped"][:, :, 35:], axis=2) == 0).all()
    np.testing.assert_array_equal(rollouts["stopped"][:, :, :22], rollouts["good"][:, :, :22])

    assert ("other_goal" in rollouts) == (kind == "choice")
    if kind == "choice":
        other = np.array([context.choice.other_xy for context in contexts])[:, None]
        assert (np.linalg.norm(ends["other_goal"] - other, axis=-1) < 0.016).all()

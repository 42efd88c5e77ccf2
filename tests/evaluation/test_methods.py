"""Rewards of `tcn` and XIRL against their formulas; baselines in the evaluation of every method."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from anyview.adversarial import gail, tpil
from anyview.config import Params, parse_params, read_yaml
from anyview.embedding.network import Embedding
from anyview.embedding.weights import load_embedding, save_embedding
from anyview.evaluation.demonstrations import imitated_demonstrations, training_clips
from anyview.evaluation.methods import Method
from anyview.evaluation.runs import Work, evaluate_group
from anyview.learners import ddpg, trpo
from anyview.pusher.batch import PusherBatch
from anyview.pusher.contexts import Context, sample_contexts
from anyview.rewards.cells import make_reward
from anyview.rewards.embedding import EmbeddingReward
from anyview.rewards.goal import GoalReward
from anyview.seeds import stream
from anyview.video.pixels import to_input
from anyview.video.sets import write_set, write_shard

METHODS = {
    "gail": Method(ddpg.make_learner, gail.make_reward),
    "tpil": Method(trpo.make_learner, tpil.make_reward),
    "tcn": Method(ddpg.make_learner, make_reward),
}


@pytest.fixture(scope="module")
def model() -> Embedding:
    torch.manual_seed(1)
    return Embedding(32, 8).eval().requires_grad_(False)


def returns(reward: EmbeddingReward, clips: np.ndarray) -> np.ndarray:
    return np.sum([reward.step(clips[:, None, t], t)[:, 0] for t in range(1, 50)], axis=0)


def test_reward_is_the_squared_distance_to_the_mean_embedding(model, expert_clips):
    reward = EmbeddingReward(model, expert_clips[:2], expert_clips[2:4, 0], time_power=2.0)
    seen = np.stack([expert_clips[2:4, 7], expert_clips[3:5, 9]], axis=1)  # 2 runs, 2 copies
    target = model(to_input(expert_clips[:2, 7])).mean(0)
    away = ((model(to_input(seen)[0]) - target) ** 2).sum(-1)
    expected = -((7 / 49) ** 2) * away.numpy() / reward.scales[0]
    np.testing.assert_allclose(reward.step(seen, 7)[0], expected, rtol=1e-4)


def test_standing_still_earns_minus_one_a_step_in_every_run(model, expert_clips):
    reward = EmbeddingReward(model, expert_clips[:2], expert_clips[2:, 0], time_power=2.0)
    still = np.repeat(expert_clips[2:, :1], 50, axis=1)
    np.testing.assert_allclose(returns(reward, still), -49, rtol=1e-4)


def test_the_demonstration_itself_earns_nothing_less_than_the_best(model, expert_clips):
    reward = EmbeddingReward(model, expert_clips[:1], expert_clips[:1, 0], time_power=2.0)
    np.testing.assert_allclose(returns(reward, expert_clips[:1]), 0, atol=1e-4)


def test_a_goal_is_the_mean_of_last_frames_whatever_the_step(model, expert_clips):
    shown, agents = expert_clips[:2], expert_clips[2:4]
    goal = model(to_input(shown[:, -1])).mean(0)
    reward = GoalReward(model, shown, agents[:, 0])
    now = agents[:, [7, 30]]  # 2 runs, 2 copies
    away, still = (
        np.linalg.norm((model(to_input(frames)) - goal).numpy(), axis=-1)
        for frames in (now.reshape(4, *now.shape[2:]), agents[:, 0])
    )
    np.testing.assert_allclose(reward.scales, still, rtol=1e-4)
    for step in (1, 49):
        expected = -away.reshape(2, 2) / still[:, None]
        np.testing.assert_allclose(reward.step(now, step), expected, rtol=1e-4)
    np.testing.assert_allclose(reward.step(agents[:, :1], 1), -1, rtol=1e-4)


def test_each_run_may_have_a_goal_of_its_own(model, expert_clips):
    own = GoalReward(model, expert_clips[:2, None], expert_clips[:2, 0])
    alone = GoalReward(model, expert_clips[1:2], expert_clips[1:2, 0])
    now = expert_clips[2:4, 20:22]
    np.testing.assert_allclose(own.step(now, 5)[1:], alone.step(now[1:], 5), rtol=1e-4)
    np.testing.assert_allclose(own.step(expert_clips[:2, -1:], 49), 0, atol=1e-3)


@pytest.fixture(scope="module")
def study(tmp_path_factory, root, model, contexts, expert_clips) -> Iterator[Params]:
    """Params for 2 runs of 4 iterations, in a folder with the clips of the expert and the embedding."""
    folder = tmp_path_factory.mktemp("methods")
    names = [f"c{index}" for index in range(len(expert_clips))]
    (folder / "data/clips/diverse").mkdir(parents=True)
    (folder / "data/splits").mkdir()
    shard = write_shard(folder / "data/clips/diverse", 0, expert_clips)
    manifest = pd.DataFrame({"clip": names, "context": [context.to_json() for context in contexts]})
    write_set(folder / "data/clips/diverse", manifest, [shard])
    split = pd.DataFrame({"clip": names, "pair": names, "split": ["validation", *["train"] * 4]})
    split.to_csv(folder / "data/splits/diverse.csv", index=False)
    save_embedding(folder / "data/models/tcn", model, {})
    values = read_yaml(root / "params.yaml")
    values["sim"]["image_size"] = 32
    values["imitation"] |= {"runs": 2, "iterations": 4}
    values["imitation"]["demonstrations"] = 1
    values["imitation"]["trpo"] |= {"batch_episodes": 2}
    values["imitation"]["ddpg"] |= {"warmup_episodes": 1, "updates_per_step": 0.2, "batch_size": 8}
    values["adversarial"]["discriminator"] |= {"batch_size": 4, "steps": 2}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield parse_params(values)


@pytest.mark.parametrize("cell", METHODS)
def test_the_evaluation_runs_each_baseline(study: Params, tmp_path: Path, cell: str):
    contexts, _ = sample_contexts(stream(1, "test"), 2)
    clips, demonstrations = imitated_demonstrations(study)
    assert clips == ["c0"]
    work = Work(cell, study, METHODS[cell], range(2), contexts, demonstrations)
    result = evaluate_group(work, tmp_path)
    assert np.isfinite(result.curve.to_numpy()).all()
    assert len(result.curve) == 2 * 4
    assert result.rollouts.shape == (2, 50, 32, 64, 3)
    np.testing.assert_array_equal(result.rollouts[1, :, :, 32:], demonstrations[0])
    if cell == "tcn":
        np.testing.assert_allclose(
            result.runs["return_still"], -49 * _scales(study, contexts, demonstrations), rtol=1e-3
        )
    else:
        assert result.curve["expert_accuracy"].between(0, 1).all()
        assert "return_still" not in result.runs


def _scales(study: Params, contexts: list[Context], demonstrations: np.ndarray) -> np.ndarray:
    batch = PusherBatch(contexts, "twist", 32)
    batch.reset()
    model = load_embedding(Path("data/models/tcn"))
    return EmbeddingReward(model, demonstrations, batch.render(), time_power=0.0).scales


def test_discriminators_learn_from_the_training_split_alone(study: Params):
    frames, rows, contexts = training_clips(study)
    assert list(rows) == [1, 2, 3, 4]
    assert len(frames) == 5
    assert [context.azimuth for context in contexts] == [
        Context.from_json(text).azimuth
        for text in pd.read_csv("data/clips/diverse/manifest.csv")["context"].iloc[1:]
    ]

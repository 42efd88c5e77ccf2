"""Returns and values of clips, against one frame at a time; a reward that looks back sees what it should."""

import runpy

import numpy as np
import pandas as pd
import torch

from anyview.adversarial.tpil import tpil_reward
from anyview.config import RewardWeights, load_params
from anyview.evaluation.runs import Work
from anyview.ranking.scores import rewards, values
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations
from anyview.video.pixels import to_input
from tests.learners.toy import clip_set


def test_a_value_is_the_last_steps_reward_of_the_frame_alone(translator, expert_clips):
    first = expert_clips[3:, 0]
    targets = translate_demonstrations(translator, expert_clips[:3], first)
    reward = DemonstrationReward(translator, *targets, first, RewardWeights(feature=1.0, image=1.0), 0.0)
    clips = expert_clips[3:]
    each = rewards(reward, clips[:, None])
    assert each.shape == (2, 1, 49)
    for step in (1, 17, 49):
        np.testing.assert_array_equal(each[:, :, step - 1], reward.step(clips[:, None, step], step))
    worth = values(reward, clips, [1, 20, 49])
    for column, time in enumerate((1, 20, 49)):
        np.testing.assert_allclose(worth[:, column], reward.step(clips[:, None, time], 49)[:, 0], rtol=1e-5)


def test_every_method_has_its_own_number_of_contexts(tmp_path, root):
    """Runs go on counting from choice to choice; contexts start again."""
    write_table = runpy.run_path(str(root / "stages" / "rank.py"))["write_table"]
    params = load_params(root / "params.yaml")
    works = [
        Work(name, evaluated, None, range(n), [], np.empty(0))
        for name, evaluated in (("ours", params), ("reach", params.imitating("reach")))
        for n in [2 * evaluated.imitation.runs]
    ]
    tables = [pd.DataFrame({"run": list(work.runs), "return": 0.5}) for work in works]
    write_table(tmp_path / "values.csv", works, tables)
    contexts = pd.read_csv(tmp_path / "values.csv").groupby("cell")["context"].apply(list)
    assert contexts["ours"] == [*range(15), *range(15)]
    assert contexts["reach"] == [*range(8), *range(8)]


def test_a_reward_of_two_frames_is_given_both(expert_clips, root):
    params = load_params(root / "params.yaml").adversarial.discriminator
    clips = clip_set(expert_clips)
    reward = tpil_reward(params, 0, [0, 1], [clips] * 2, [clips] * 2)
    worth = values(reward, expert_clips[3:], [10, 49])
    for run, network in enumerate(reward.networks):
        features = network.features(to_input(expert_clips[3 + run][[7, 10, 46, 49]]))
        pairs = features.view(2, 2, -1)
        expected = network.score(pairs[:, 0], pairs[:, 1], torch.ones(2)).tolist()
        np.testing.assert_allclose(worth[run], expected, rtol=1e-4, atol=1e-6)

"""The translated reward as a Gymnasium environment: it passes the checker, and other learners train on it."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import DDPG

from anyview.config import RewardWeights
from anyview.environments.pusher import PusherEnv
from anyview.environments.translated import TranslatedReward
from anyview.pusher.batch import PusherBatch
from anyview.rewards.demonstration import DemonstrationReward, translate_demonstrations

WEIGHTS = RewardWeights(feature=1.0, image=0.3)


@pytest.fixture
def env(translator, contexts, expert_clips) -> TranslatedReward:
    pusher = PusherEnv(contexts[4], image_size=32, render_mode="rgb_array")
    return TranslatedReward(pusher, translator, expert_clips[:2], WEIGHTS)


@pytest.mark.filterwarnings("ignore:.*not within the observation space.*")
def test_passes_gymnasiums_checker(env: TranslatedReward) -> None:
    check_env(env, skip_render_check=True)


def test_rewards_what_the_lockstep_evaluation_would(env, translator, contexts, expert_clips) -> None:
    batch = PusherBatch([contexts[4]], image_size=32)
    batch.reset()
    first = batch.render()
    reward = DemonstrationReward(
        translator,
        *translate_demonstrations(translator, expert_clips[:2], first),
        first,
        WEIGHTS,
        time_power=0.0,
    )
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for step in range(1, 50):
        action = rng.uniform(-1, 1, 3).astype(np.float32)
        _, got, terminated, truncated, info = env.step(action)
        batch.step(action[None])
        assert got == pytest.approx(reward.step(batch.render()[:, None], step)[0, 0], rel=1e-5)
        assert (terminated, truncated) == (step == 49, False)
    assert info["distance"] == pytest.approx(batch.distance()[0])


def test_stable_baselines3_trains_on_it(env: TranslatedReward) -> None:
    model = DDPG(
        "MlpPolicy", env, learning_starts=49, batch_size=16, seed=0, policy_kwargs={"net_arch": [16]}
    )
    before = [weights.detach().clone() for weights in model.actor.parameters()]
    model.learn(110)
    assert model.num_timesteps >= 110
    assert any((a != b).any() for a, b in zip(before, model.actor.parameters(), strict=True))

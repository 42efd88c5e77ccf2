"""Train a policy of Stable-Baselines3 on the translated demonstration's reward.

    python examples/train_with_stable_baselines3.py [STEPS]

Run it from the root of the repository after `dvc repro train@sim`. It trains SAC in one context that no
evaluation uses, and prints how far from the goal the object ends.
"""

import sys

from stable_baselines3 import SAC

from anyview import paths
from anyview.config import load_params
from anyview.environments.pusher import PusherEnv
from anyview.environments.translated import TranslatedReward
from anyview.evaluation.demonstrations import imitated_demonstrations
from anyview.pusher.contexts import sample_contexts
from anyview.runtime.errors import exit_code
from anyview.seeds import stream
from anyview.translator.weights import load_translator


def main(steps: int) -> None:
    params = load_params()
    contexts, _ = sample_contexts(stream(params.base.seed, "example"), 1)
    pusher = PusherEnv(
        contexts[0], control=params.sim.control, image_size=params.sim.image_size, render_mode="rgb_array"
    )
    translator = load_translator(paths.model("sim"))
    demonstrations = imitated_demonstrations(params).frames
    env = TranslatedReward(pusher, translator, demonstrations, params.imitation.cells["ours"].weights)

    model = SAC("MlpPolicy", env, gamma=0.8, learning_starts=490, seed=params.base.seed, verbose=1)
    model.learn(steps)

    observation, info = env.reset()
    finished = False
    while not finished:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, finished, _, info = env.step(action)
    print(f"after {steps} steps: {100 * info['distance']:.1f} cm from the goal")


if __name__ == "__main__":
    sys.exit(exit_code(lambda: main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)))

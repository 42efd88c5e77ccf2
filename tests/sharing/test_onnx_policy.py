"""Policies as ONNX files, acted out by onnxruntime, against the same network in plain NumPy."""

from itertools import pairwise

import numpy as np
import pytest

from anyview.learners.common.policies import Policy
from anyview.pusher.contexts import sample_contexts
from anyview.runtime.errors import AnyviewError

onnxruntime = pytest.importorskip("onnxruntime")
from anyview.sharing.onnx_policy import check_actions, to_onnx  # noqa: E402

SIZE = 15


def policy(learner: str, features: int, rng: np.random.Generator) -> Policy:
    sizes = [SIZE + features, 32, 16, 3]
    weights = {}
    for index, (inputs, outputs) in enumerate(pairwise(sizes)):
        weights[f"weight{index}"] = rng.normal(0, 0.5, (inputs, outputs)).astype(np.float32)
        weights[f"bias{index}"] = rng.normal(0, 0.5, outputs).astype(np.float32)
    contexts, _ = sample_contexts(rng, 1, "diverse")
    return Policy(learner, "twist", 64, contexts[0], weights)


def plain(learner: str, weights: dict[str, np.ndarray], features: int, x: np.ndarray) -> np.ndarray:
    """In float64. Gaussians of time have centres from -1 to 1, and 0.8 of their distance as deviation."""
    if features:
        centres = [-1 + 2 * k / (features - 1) for k in range(features)]
        deviation = 0.8 * 2 / (features - 1)
        x = np.hstack([x, *(np.exp(-(((x[:, -1:] - c) / deviation) ** 2) / 2) for c in centres)])
    for index in range(3):
        x = x @ weights[f"weight{index}"].astype(float) + weights[f"bias{index}"]
        if index < 2:
            x = np.maximum(x, 0) if learner == "ddpg" else np.tanh(x)
    return np.tanh(x) if learner == "ddpg" else np.clip(x, -1, 1)


@pytest.mark.parametrize(("learner", "features"), [("ddpg", 8), ("ddpg", 0), ("trpo", 0)])
def test_a_runtime_acts_as_the_policy(learner, features):
    rng = np.random.default_rng(0)
    ours = policy(learner, features, rng)
    observations = rng.uniform(-1, 1, (50, SIZE)).astype(np.float32)
    model = to_onnx(ours, SIZE)
    assert model == to_onnx(ours, SIZE)
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    assert [(end.name, end.shape) for end in session.get_inputs()] == [("observation", ["N", SIZE])]
    (actions,) = session.run(None, {"observation": observations})
    np.testing.assert_allclose(actions, plain(learner, ours.weights, features, observations), atol=1e-5)
    assert check_actions(model, ours, observations) < 1e-5
    told = session.get_modelmeta().custom_metadata_map
    assert told["control"] == "twist"
    assert told["context"] == ours.context.to_json()


def test_a_file_that_acts_otherwise_is_refused():
    rng = np.random.default_rng(1)
    one, other = policy("ddpg", 8, rng), policy("ddpg", 8, rng)
    with pytest.raises(AnyviewError, match="differ by"):
        check_actions(to_onnx(one, SIZE), other, rng.uniform(-1, 1, (5, SIZE)).astype(np.float32))

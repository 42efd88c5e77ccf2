"""A policy as an ONNX file, which acts in any program that has an ONNX runtime."""

import json
from typing import Any

import numpy as np
import onnxruntime
from onnx import ModelProto, TensorProto, checker, helper, numpy_helper

from anyview.learners.common.policies import Policy
from anyview.runtime.errors import AnyviewError

_OPSET, _IR = 17, 8  # of 2022: runtimes that are years old read them
_TOLERANCE = 1e-5  # of actions in [-1, 1]: float32 sums in another order


def to_onnx(policy: Policy, observation_size: int) -> bytes:
    """The network of ``policy``: ``observation`` (N, O) to ``action`` (N, 3), both float32.

    O is ``observation_size``. What else it takes to act, the control and the context, is in the metadata.
    """
    graph = _Graph()
    ddpg = policy.learner == "ddpg"
    features = len(policy.weights["weight0"]) - observation_size if ddpg else 0
    x = _with_time_features(graph, "observation", features) if features else "observation"
    layers = len(policy.weights) // 2
    for index in range(layers):
        x = graph.add("MatMul", x, graph.constant(policy.weights[f"weight{index}"]))
        x = graph.add("Add", x, graph.constant(policy.weights[f"bias{index}"]))
        if index < layers - 1:
            x = graph.add("Relu" if ddpg else "Tanh", x)
    bounds = [] if ddpg else [graph.constant(np.float32(-1)), graph.constant(np.float32(1))]
    graph.add("Tanh" if ddpg else "Clip", x, *bounds, output="action")
    metadata = {
        "learner": policy.learner,
        "control": policy.control,
        "context": policy.context.to_json(),
        "image_size": json.dumps(policy.image_size),
    }
    model = graph.model(observation_size, len(policy.weights[f"bias{layers - 1}"]), metadata)
    return model.SerializeToString(deterministic=True)


def check_actions(model: bytes, policy: Policy, observations: np.ndarray) -> float:
    """Let onnxruntime act for ``observations`` (N, O); returns the largest difference from ``policy``.

    Raises AnyviewError if that is more than float32 explains.
    """
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    (actions,) = session.run(["action"], {"observation": observations.astype(np.float32)})
    difference = float(np.abs(actions - np.stack([policy.act(each) for each in observations])).max())
    if not difference <= _TOLERANCE:
        raise AnyviewError(f"onnxruntime and the policy differ by {difference:g}; nothing is written")
    return difference


def _with_time_features(graph: "_Graph", observation: str, count: int) -> str:
    """As ``policies.with_time_features``."""
    ends = (graph.constant(np.array([end])) for end in (-1, np.iinfo(np.int64).max, 1))  # from, to, axis
    time = graph.add("Slice", observation, *ends)
    away = graph.add("Sub", time, graph.constant(np.linspace(-1, 1, count, dtype=np.float32)))
    deviations = graph.add("Mul", away, graph.constant(np.float32((count - 1) / 2 / 0.8)))
    square = graph.add("Mul", deviations, deviations)
    bumps = graph.add("Exp", graph.add("Mul", square, graph.constant(np.float32(-0.5))))
    return graph.add("Concat", observation, bumps, axis=1)


class _Graph:
    """Nodes that follow on one another, and their constants."""

    def __init__(self) -> None:
        self._nodes: list = []
        self._constants: list = []

    def constant(self, value: np.ndarray | np.generic) -> str:
        name = f"constant{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def add(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or f"value{len(self._nodes)}"
        self._nodes.append(helper.make_node(operator, inputs, [output], **attributes))
        return output

    def model(self, inputs: int, outputs: int, metadata: dict[str, str]) -> ModelProto:
        """The checked model from ``observation`` to ``action``."""
        ends = [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["N", size])
            for name, size in (("observation", inputs), ("action", outputs))
        ]
        graph = helper.make_graph(self._nodes, "policy", ends[:1], ends[1:], self._constants)
        opset = helper.make_opsetid("", _OPSET)
        model = helper.make_model(graph, opset_imports=[opset], ir_version=_IR, producer_name="anyview")
        helper.set_model_props(model, metadata)
        checker.check_model(model, full_check=True)
        return model

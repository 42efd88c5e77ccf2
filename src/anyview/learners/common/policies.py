"""Trained policies on disk: ``policy-<run>.safetensors`` beside ``policy.json``. Nothing in them is code."""

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.numpy import load, save
from torch import Tensor

from anyview.learners.common.interfaces import Arrays
from anyview.pusher.batch import ACTION_SIZE, observation_size
from anyview.pusher.contexts import Context
from anyview.runtime.errors import AnyviewError
from anyview.runtime.outputs import write_atomically

LearnerName = Literal["ddpg", "trpo"]
ControlName = Literal["twist", "torque"]
_DESCRIPTION = "policy.json"


def with_time_features(observations: Tensor, count: int) -> Tensor:
    """``observations`` (..., O), then ``count`` radial basis functions of their last entry, time in [-1, 1].

    Function k of n is a Gaussian with its centre at -1 + 2 k/(n - 1) and a deviation of 0.8 of the spacing.
    """
    centres = torch.linspace(-1, 1, count, device=observations.device)
    away = (observations[..., -1:] - centres) * ((count - 1) / 2)
    return torch.cat([observations, torch.exp(-0.5 * (away / 0.8) ** 2)], dim=-1)


@dataclass(frozen=True)
class Policy:
    """One run's deterministic policy, its context and the control that it was trained for.

    ``weights`` are ``weight<i>`` (in, out) and ``bias<i>`` (out). DDPG has ReLU layers, a tanh at the end and
    radial basis functions of time beside the observation; TRPO has tanh layers and clips its mean to [-1, 1].
    """

    learner: LearnerName
    control: ControlName
    image_size: int
    context: Context
    weights: Arrays

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Action (3,) in [-1, 1] for ``observation`` (O,)."""
        x = torch.from_numpy(np.asarray(observation, np.float32))
        layers = len(self.weights) // 2
        ddpg = self.learner == "ddpg"
        if ddpg:
            x = with_time_features(x, len(self.weights["weight0"]) - len(x))
        for index in range(layers):
            weight, bias = (torch.from_numpy(self.weights[f"{kind}{index}"]) for kind in ("weight", "bias"))
            x = x @ weight + bias
            if index < layers - 1:
                x = torch.relu(x) if ddpg else torch.tanh(x)
        return (torch.tanh(x) if ddpg else x.clamp(-1, 1)).numpy()


def save_policies(
    folder: Path,
    weights: Arrays,
    contexts: list[Context],
    learner: LearnerName,
    control: ControlName,
    image_size: int,
) -> None:
    """Write the policies ``weights`` (R, ...) of runs 0 to R - 1 and what is needed to act with them."""
    for run in range(len(contexts)):
        own = {name: np.ascontiguousarray(array[run]) for name, array in weights.items()}
        write_atomically(folder / f"policy-{run}.safetensors", save(own))
    description = {
        "learner": learner,
        "control": control,
        "image_size": image_size,
        "contexts": [json.loads(context.to_json()) for context in contexts],
    }
    write_atomically(folder / _DESCRIPTION, json.dumps(description, indent=1) + "\n")


def load_policy(folder: Path, run: int) -> Policy:
    """The policy of ``run``; AnyviewError where it is missing or damaged."""
    description = _read_description(folder / _DESCRIPTION)
    count = len(description["contexts"])
    if not 0 <= run < count:
        raise AnyviewError(f"{folder}: no run {run}; there are runs 0 to {count - 1}")
    path = folder / f"policy-{run}.safetensors"
    try:
        weights = load(path.read_bytes())
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; run the cell again") from None
    except SafetensorError as error:
        raise AnyviewError(f"{path}: not a safetensors file: {error}") from None
    if not _fits(weights):
        raise AnyviewError(f"{path}: does not hold the weights of a policy; run the cell again")
    try:
        context = Context.from_json(json.dumps(description["contexts"][run]))
    except (KeyError, TypeError, ValueError):
        raise AnyviewError(f"{folder / _DESCRIPTION}: the context of run {run} is damaged") from None
    entries, inputs = observation_size(context.task, len(context.goals)), len(weights["weight0"])
    if inputs < entries or (description["learner"] == "trpo" and inputs > entries):
        raise AnyviewError(f"{path}: takes {inputs} inputs; in the context of run {run} there are {entries}")
    return Policy(description["learner"], description["control"], description["image_size"], context, weights)


def _read_description(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnyviewError(f"{path}: no such file; evaluate the method by `dvc repro` first") from None
    except (ValueError, RecursionError) as error:
        raise AnyviewError(f"{path}: not valid JSON: {error}") from None
    keys = {"learner": str, "control": str, "image_size": int, "contexts": list}
    known = {"learner": get_args(LearnerName), "control": get_args(ControlName)}
    if not isinstance(values, dict) or any(not isinstance(values.get(k), kind) for k, kind in keys.items()):
        raise AnyviewError(f"{path}: does not describe policies: needs {', '.join(keys)}")
    for key, names in known.items():
        if values[key] not in names:
            raise AnyviewError(f"{path}: {key} {values[key]!r} is none of {', '.join(names)}")
    return values


def _fits(weights: Arrays) -> bool:
    """Whether the layers follow on one another, from an observation to an action."""
    layers = len(weights) // 2
    names = {f"{kind}{index}" for kind in ("weight", "bias") for index in range(layers)}
    if not layers or set(weights) != names:
        return False
    matrices = [weights[f"weight{index}"] for index in range(layers)]
    biases = [weights[f"bias{index}"] for index in range(layers)]
    if any(w.ndim != 2 or b.shape != w.shape[1:] for w, b in zip(matrices, biases, strict=True)):
        return False
    chained = all(a.shape[1] == b.shape[0] for a, b in pairwise(matrices))
    return chained and matrices[-1].shape[1] == ACTION_SIZE

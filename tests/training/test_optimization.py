"""The learning rate, and the optimiser that threads share, which is one optimiser for all parameters."""

from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import nn

from anyview.training.common.optimization import SharedOptimizer, learning_rate

SHAPES = [(4, 3, 5, 5), (4,), (7, 12), (7,), (2, 7), (2,)]
MAKES = {
    "adam": lambda parameters: torch.optim.Adam(parameters, fused=True),
    "adadelta": lambda parameters: torch.optim.Adadelta(parameters),
}


def test_learning_rate_stays_or_falls_along_a_cosine(make_objective):
    constant, cosine = make_objective().training, make_objective(schedule="cosine").training
    assert [learning_rate(constant, n, 10) for n in (0, 9)] == [0.001, 0.001]
    assert [learning_rate(cosine, n, 10) for n in (0, 5, 10)] == pytest.approx([0.001, 0.0005, 0.0])


def draw(generator: torch.Generator) -> list[torch.Tensor]:
    return [torch.randn(shape, generator=generator) for shape in SHAPES]


@pytest.mark.parametrize("kind", MAKES)
@given(
    threads=st.integers(1, 4),
    parts=st.integers(1, 3),
    missing=st.sets(st.integers(0, len(SHAPES) - 1), max_size=3),
    dtype=st.sampled_from([torch.float32, torch.bfloat16]),
    seed=st.integers(0, 99),
)
def test_it_moves_as_one_optimizer_of_the_summed_gradients(kind, threads, parts, missing, dtype, seed):
    """For any number of threads, and after a restore; parameters that the loss does not reach stay.

    What gradients are taken of has the parameters as they are, in the precision of the products.
    """
    generator = torch.Generator().manual_seed(seed)
    start = draw(generator)
    ours = [nn.Parameter(tensor.clone()) for tensor in start]
    one = [nn.Parameter(tensor.clone()) for tensor in start]
    model, whole = nn.ParameterList(ours), MAKES[kind](one)
    shared = SharedOptimizer(model, MAKES[kind], threads, dtype)
    with ThreadPoolExecutor(threads) as pool:
        for step in range(4):
            gradients = [[g.to(dtype) for g in draw(generator)] for _ in range(parts)]
            for group in whole.param_groups:
                group["lr"] = 0.1 / (step + 1)
            for n, parameter in enumerate(one):
                parameter.grad = None if n in missing else sum(part[n].float() for part in gradients)
            whole.step()
            reached = [[None if n in missing else g for n, g in enumerate(part)] for part in gradients]
            if step == 2:
                state = shared.arrays()
                shared = SharedOptimizer(model, MAKES[kind], threads, dtype)
                shared.restore(state)
            shared.step(0.1 / (step + 1), reached, pool)
            for working, parameter in zip(shared.working.parameters(), ours, strict=True):
                assert torch.equal(working, parameter.to(dtype))
    for n, (mine, theirs) in enumerate(zip(ours, one, strict=True)):
        torch.testing.assert_close(mine, theirs, rtol=1e-6, atol=1e-7)
        assert torch.equal(mine, start[n]) == (n in missing)

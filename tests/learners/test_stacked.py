"""Stacked networks and their optimiser against torch's own, one by one."""

import numpy as np
import torch

from anyview.learners.common.stacked import Adam, StackedMLP


def test_adam_is_that_of_torch() -> None:
    """Ten steps on two networks, rates included."""
    network = StackedMLP.initial([3, 8, 2], np.random.default_rng(0).spawn(2), torch.device("cpu"))
    ours = Adam(network)
    copies = [[part[row].detach().clone() for layer in network.layers for part in layer] for row in range(2)]
    for copy in copies:
        for part in copy:
            part.requires_grad_()
    theirs = [torch.optim.Adam(copy) for copy in copies]
    generator = torch.Generator().manual_seed(0)
    for step in range(10):
        inputs, rate = torch.randn(2, 5, 3, generator=generator), 0.01 / (step + 1)
        ours.descend((network(inputs) ** 2).sum(), rate)
        for row, (copy, optimizer) in enumerate(zip(copies, theirs, strict=True)):
            hidden = torch.relu(inputs[row] @ copy[0] + copy[1])
            optimizer.zero_grad()
            ((hidden @ copy[2] + copy[3]) ** 2).sum().backward()
            optimizer.param_groups[0]["lr"] = rate
            optimizer.step()
    for row, copy in enumerate(copies):
        stacked = [part[row].detach() for layer in network.layers for part in layer]
        for mine, other in zip(stacked, copy, strict=True):
            torch.testing.assert_close(mine, other.detach(), rtol=1e-4, atol=1e-6)

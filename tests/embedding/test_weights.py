"""Embeddings on disk."""

import pytest
import torch

from anyview.embedding.network import Embedding
from anyview.embedding.weights import load_embedding, save_embedding
from anyview.runtime.errors import AnyviewError


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(1)
    model = Embedding(16, 8)
    save_embedding(tmp_path, model, {"best_iteration": 7})
    return tmp_path, model


def test_a_saved_embedding_comes_back(saved):
    folder, model = saved
    frames = torch.rand(3, 3, 16, 16)
    loaded = load_embedding(folder)
    assert torch.equal(loaded(frames), model(frames))
    torch.testing.assert_close(loaded(frames).norm(dim=-1), torch.ones(3))
    assert not any(parameter.requires_grad for parameter in loaded.parameters())


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda folder: (folder / "model.json").unlink(), "model.json: no such file"),
        (lambda folder: (folder / "model.json").write_text("{"), "not valid JSON"),
        (
            lambda folder: (folder / "model.json").write_text('{"image_size": 16}'),
            "dimensions must be a whole number",
        ),
        (lambda folder: (folder / "weights.safetensors").unlink(), "weights.safetensors: no such file"),
        (lambda folder: (folder / "weights.safetensors").write_bytes(b"x"), "not a safetensors file"),
        (
            lambda folder: (folder / "model.json").write_text('{"image_size": 16, "dimensions": 9}'),
            "does not hold the weights",
        ),
    ],
    ids=["no description", "not JSON", "keys missing", "no weights", "not weights", "other weights"],
)
def test_a_damaged_model_is_refused_by_name(saved, damage, message):
    folder, _ = saved
    damage(folder)
    with pytest.raises(AnyviewError, match=message):
        load_embedding(folder)

"""Translators on disk."""

import json

import pytest
import torch
from safetensors import safe_open

from anyview.runtime.errors import AnyviewError
from anyview.translator.architectures import embed_task
from anyview.translator.network import ContextTranslator
from anyview.translator.weights import load_translator, read_meta, save_translator


@pytest.fixture(params=["real", "compact"])
def saved(request, tmp_path):
    torch.manual_seed(1)
    model = ContextTranslator(request.param, 16)
    save_translator(tmp_path, model, {"best_iteration": 7})
    return tmp_path, model


def test_a_saved_translator_comes_back(saved):
    folder, model = saved
    loaded = load_translator(folder)
    frames = torch.rand(3, 3, 16, 16)
    with torch.no_grad():
        z2, skips = model.encode_context(frames)
        other, others = loaded.encode_context(frames)
        assert torch.equal(z2, other)
        assert torch.equal(model.decode(z2, skips), loaded.decode(other, others))
    assert not any(parameter.requires_grad for parameter in loaded.parameters())
    assert read_meta(folder)["best_iteration"] == 7


def test_shared_weights_are_stored_once_and_stay_shared(saved):
    folder, model = saved
    with safe_open(folder / "weights.safetensors", "pt") as stored:
        names = set(stored.keys())
    assert any(name.startswith("context_encoder") for name in names) != model.shared
    loaded = load_translator(folder)
    assert loaded.shared == model.shared
    assert sum(p.numel() for p in loaded.parameters()) == sum(p.numel() for p in model.parameters())


@pytest.mark.parametrize("name", ["weights.safetensors", "model.json"])
@pytest.mark.parametrize("content", [None, b"", b"\x80\x04.", b"{}", b"[1]", b'{"a":' * 100_000])
def test_broken_files_are_named(saved, name, content):
    folder, _ = saved
    if content is None:
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(content)
    with pytest.raises(AnyviewError, match=name):
        load_translator(folder)


def test_weights_of_another_model_are_refused(saved):
    folder, model = saved
    meta = json.loads((folder / "model.json").read_text())
    meta["architecture"] = "compact" if model.architecture == "real" else "real"
    (folder / "model.json").write_text(json.dumps(meta))
    with pytest.raises(AnyviewError, match="does not hold the weights"):
        load_translator(folder)


@pytest.mark.parametrize("size", [10**9, 16_000, 0, -16, 16.0, "16", None])
def test_an_impossible_size_is_refused_before_it_takes_memory(saved, size):
    folder, _ = saved
    meta = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps(meta | {"image_size": size}))
    with pytest.raises(AnyviewError, match=r"model\.json: image_size must be a whole number from 1 to 256"):
        load_translator(folder)


@pytest.mark.parametrize("architecture", [None, 7, [], {}, "../real"])
def test_an_impossible_architecture_is_refused(saved, architecture):
    folder, _ = saved
    meta = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps(meta | {"architecture": architecture}))
    with pytest.raises(AnyviewError, match="architecture"):
        load_translator(folder)


def test_a_translator_with_a_task_embedding_comes_back_with_it(tmp_path):
    torch.manual_seed(1)
    model = ContextTranslator("compact", 16, task_embedding=True)
    save_translator(tmp_path, model, {})
    loaded = load_translator(tmp_path)
    z1, z2 = torch.randn(2, 9, 256)
    with torch.no_grad():
        expected = model.translate(z1, z2, embed_task(model, z1))
        assert torch.equal(loaded.translate(z1, z2, embed_task(loaded, z1)), expected)

import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from anyview.runtime.checkpoints import Checkpoints
from anyview.runtime.errors import AnyviewError

ARRAYS = st.dictionaries(
    st.text("abcxyz./-", min_size=1, max_size=8),
    arrays_of.arrays(
        st.sampled_from([np.float32, np.float64, np.int64, np.uint8, np.bool_]),
        arrays_of.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
    ),
    max_size=3,
)
STATE = st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False) | st.integers() | st.text(max_size=5))


@pytest.fixture
def folder(tmp_path) -> Path:
    return tmp_path


def weights(step: int) -> dict[str, np.ndarray]:
    return {"w": np.arange(6.0).reshape(2, 3) + step, "t": np.array(step)}


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(arrays=ARRAYS, state=STATE, step=st.integers(0, 10**9))
def test_what_is_loaded_is_what_was_saved(folder, arrays, state, step):
    checkpoints = Checkpoints(folder)
    checkpoints.clear()
    checkpoints.save(step, arrays, state)
    found = Checkpoints(folder).load()
    assert found is not None
    assert (found[0], found[2]) == (step, state)
    assert found[1].keys() == arrays.keys()
    for name, array in arrays.items():
        assert (found[1][name].dtype, found[1][name].shape) == (array.dtype, array.shape)
        assert found[1][name].tobytes() == array.tobytes()


def test_views_that_are_not_contiguous_keep_their_order(folder):
    transposed = np.arange(6.0).reshape(2, 3).T
    Checkpoints(folder).save(1, {"w": transposed}, {})
    np.testing.assert_array_equal(Checkpoints(folder).load()[1]["w"], transposed)


def test_the_newest_is_used_and_two_are_kept(folder):
    for step in (1, 2, 3):
        Checkpoints(folder).save(step, weights(step), {})
    assert len(list(folder.iterdir())) == 2
    assert Checkpoints(folder).load()[0] == 3


@pytest.mark.parametrize("harm", ["cut", "flip", "empty", "remove"])
def test_a_harmed_checkpoint_gives_way_to_the_one_before(folder, harm):
    checkpoints = Checkpoints(folder)
    for step in (1, 2):
        checkpoints.save(step, weights(step), {"step": step})
    newest = max(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    content = newest.read_bytes()
    if harm == "remove":
        newest.unlink()
    elif harm == "flip":
        newest.write_bytes(content[:-3] + bytes([content[-3] ^ 1]) + content[-2:])
    else:
        newest.write_bytes(content[: len(content) // 2] if harm == "cut" else b"")
    resumed = Checkpoints(folder)
    assert resumed.load()[0] == 1
    resumed.save(5, weights(5), {})  # must replace the harmed one, not the good one
    assert {Checkpoints(folder).load()[0]} == {5}
    newest.unlink()
    assert Checkpoints(folder).load()[0] == 1


def test_mutated_files_are_refused_without_an_error(folder):
    checkpoints = Checkpoints(folder)
    checkpoints.save(7, weights(7), {"loss": 0.5})
    (path,) = folder.iterdir()
    content = path.read_bytes()
    rng = random.Random(0)
    for _ in range(200):
        mutant = bytearray(content)
        for _ in range(rng.randint(1, 4)):
            place = rng.randrange(len(mutant))
            kind = rng.randrange(3)
            if kind == 0:
                mutant[place] ^= 1 << rng.randrange(8)
            elif kind == 1:
                del mutant[place : place + rng.randint(1, 40)]
            else:
                mutant[place:place] = rng.randbytes(rng.randint(1, 40))
        path.write_bytes(mutant)
        assert bytes(mutant) == content or Checkpoints(folder).load() is None


def test_a_well_formed_file_of_another_kind_is_refused(folder):
    """Whoever can write a correct checksum still gets no further than "no checkpoint"."""
    import hashlib
    import json

    def forge(metadata: dict) -> bytes:
        header = json.dumps({"__metadata__": metadata}).encode()
        body = len(header).to_bytes(8, "little") + header
        return b"anyview-checkpoint-1\n" + hashlib.sha256(body).hexdigest().encode() + b"\n" + body

    nested = {"step": "1", "state": '{"a":' * 100_000}
    for metadata in ({}, {"step": "x", "state": "{}"}, {"step": "1", "state": "{"}, {"step": "1"}, nested):
        (folder / "checkpoint-a").write_bytes(forge(metadata))
        assert Checkpoints(folder).load() is None


def test_due_follows_the_clock(folder, monkeypatch):
    monkeypatch.setenv("ANYVIEW_CHECKPOINT_SECONDS", "60")
    checkpoints = Checkpoints(folder)
    assert not checkpoints.due()
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + 61)
    assert checkpoints.due()
    checkpoints.save(1, {}, {})
    assert not checkpoints.due()


@pytest.mark.parametrize("value", ["soon", "-1", "nan", ""])
def test_an_impossible_interval_is_named(folder, monkeypatch, value):
    monkeypatch.setenv("ANYVIEW_CHECKPOINT_SECONDS", value)
    with pytest.raises(AnyviewError, match=f"ANYVIEW_CHECKPOINT_SECONDS={value}: must be"):
        Checkpoints(folder)


def test_clear_leaves_nothing(folder):
    checkpoints = Checkpoints(folder)
    for step in (1, 2):
        checkpoints.save(step, weights(step), {})
    checkpoints.clear()
    assert list(folder.iterdir()) == []
    assert checkpoints.load() is None


_WRITER = """
import sys, numpy as np
from pathlib import Path
from anyview.runtime.checkpoints import Checkpoints
checkpoints = Checkpoints(Path(sys.argv[1]))
found = checkpoints.load()
step = found[0] if found else 0
print(step, flush=True)
while True:
    step += 1
    checkpoints.save(step, {"w": np.full(200_000, step)}, {"step": step})
    print(step, flush=True)
"""


def test_a_process_killed_while_it_writes_loses_one_step_at_most(folder):
    """SIGKILL at random moments: there is always a whole checkpoint, and steps never go back."""
    last = 0
    rng = random.Random(1)
    for _ in range(6):
        process = subprocess.Popen(
            [sys.executable, "-c", _WRITER, str(folder)], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        began = int(process.stdout.readline())
        assert began >= last
        assert int(process.stdout.readline()) == began + 1  # however long a busy disk takes for the first
        time.sleep(rng.random() * 0.2)
        process.kill()
        process.wait()
        found = Checkpoints(folder).load()
        assert found is not None
        last, arrays, state = found
        assert last > began
        assert (arrays["w"] == last).all()
        assert state == {"step": last}
    assert all(os.stat(path).st_size for path in folder.glob("checkpoint-?"))

import os
import pty
import subprocess
import sys
from contextlib import suppress

import pytest

from anyview.runtime import progress
from anyview.runtime.progress import track


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass when a test says so."""
    now = [1000.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_a_log_file_gets_a_line_now_and_then(capsys, clock):
    with track("train sim", 1000) as tracker:
        for _ in range(1000):
            clock[0] += 0.05
            tracker.advance(note="loss 5")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4  # every 15 of 50 seconds, and the end
    assert lines[0].startswith("train sim: 30")
    assert lines[0].endswith("s left) loss 5")
    assert lines[-1].startswith("train sim: 1000/1000 (0 s left)")
    assert not any("\x1b" in line or "\r" in line for line in lines)


def test_the_time_left_after_a_resume_counts_only_new_work(capsys, clock):
    with track("train sim", 1000, done=900) as tracker:
        clock[0] += 20
        tracker.advance(50)
    assert capsys.readouterr().out == "train sim: 950/1000 (20 s left)\n"


def test_a_terminal_gets_a_bar():
    parent, child = pty.openpty()
    script = "from anyview.runtime.progress import track\nwith track('film', 3) as t:\n    t.advance(3)"
    done = subprocess.run([sys.executable, "-c", script], stdout=child, env={**os.environ, "TERM": "xterm"})
    os.close(child)
    shown = ""
    with suppress(OSError):  # as reading a terminal ends
        while part := os.read(parent, 4096).decode():
            shown += part
    assert done.returncode == 0
    assert "film" in shown
    assert "3/3" in shown

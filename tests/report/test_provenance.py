"""Our hashes are DVC's own."""

import os
import subprocess
import sys

from ruamel.yaml import YAML

from anyview.report.provenance import dvc_hash


def test_hashes_equal_those_in_dvc_lock(tmp_path):
    folder = tmp_path / "data"
    (folder / "b" / "c").mkdir(parents=True)
    for name in ("z.csv", "b/ü.txt", "b/c/1", "b-2", "B"):
        (folder / name).write_bytes(name.encode() * 3)
    (tmp_path / "one.csv").write_bytes(b"a,b\r\n1,2\r\n")
    pipeline = {"stages": {"s": {"cmd": "true", "deps": ["data", "one.csv"]}}}
    with (tmp_path / "dvc.yaml").open("w") as handle:
        YAML(typ="safe").dump(pipeline, handle)
    environment = os.environ | {"DVC_NO_ANALYTICS": "1"}
    for arguments in (["init", "--no-scm", "-q"], ["repro", "-q"]):
        command = [sys.executable, "-m", "dvc", *arguments]
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env=environment)
    lock = YAML(typ="safe").load(tmp_path / "dvc.lock")["stages"]["s"]["deps"]
    assert {entry["path"]: entry["md5"] for entry in lock} == {
        "data": dvc_hash(folder),
        "one.csv": dvc_hash(tmp_path / "one.csv"),
    }

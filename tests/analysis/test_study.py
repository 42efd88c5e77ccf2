"""Reading the stages' outputs: what is broken is named in one line."""

import pytest

from anyview.analysis.study import read_study
from anyview.runtime.errors import AnyviewError


def test_nothing_to_report_is_said(tmp_path, params):
    with pytest.raises(AnyviewError, match="nothing to report on yet"):
        read_study(params, tmp_path)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("policies/ours/runs.csv", "run,success\n0,True\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n0,True,near\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n0,True,\n"),
        ("policies/ours/runs.csv", "run,success,final_distance\n"),
        ("policies/ours/curve.csv", "\x00\x01"),
        ("models/sim/model.json", "{"),
        ("models/sim/model.json", "{}"),
        ("translations/sim/clips.csv", "clip,split\n"),
    ],
)
def test_a_broken_input_is_named(data, params, file, content):
    data.translator("sim")
    data.policies("ours", 0.03)
    (data.root / "data" / file).write_text(content)
    with pytest.raises(AnyviewError, match=file.rsplit("/", 1)[1]):
        read_study(params, data.root)

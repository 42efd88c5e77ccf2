"""The data have the same bytes on every processor: made with the kernels that another one would choose."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__

from tests.long_stages import change, digests

SMALLEST = {
    "simulate.shard": 4,
    "simulate.sets.diverse.demos": 6,
    "simulate.sets.narrow.demos": 2,
    "real.film.pairs": 1,
    "real.film.singles": 1,
    "real.film.extreme_pairs": 0,
    "real.film.width": 160,
    "real.render.demonstrations": 3,
    "real.render.moments": 2,
}


def data(folder: Path, root: Path, *arguments: str, **environment: str) -> dict[str, str]:
    """Digests of the data of the smallest study, made in the new ``folder``."""
    folder.mkdir()
    shutil.copy(root / "params.yaml", folder)
    change(folder, SMALLEST)
    done = subprocess.run(
        [sys.executable, "-m", "tests.data_stages", *arguments],
        cwd=folder,
        env=os.environ
        | {
            "PYTHONPATH": f"{root / 'src'}:{root}",
            "ANYVIEW_SCRATCH": str(folder.parent / "scratch"),
            "ANYVIEW_WORKERS": "1",
        }
        | environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return digests(folder / "data")


@pytest.fixture(scope="module")
def haswell(root, tmp_path_factory) -> dict[str, str]:
    """The data as the oldest processor with AVX2 makes them."""
    features = " ".join(name for name in __cpu_dispatch__ if name != "X86_V3")  # all that need AVX-512
    return data(
        tmp_path_factory.mktemp("haswell") / "study",
        root,
        OPENBLAS_CORETYPE="Haswell",
        NPY_DISABLE_CPU_FEATURES=features,
    )


def test_a_processor_with_avx_512_makes_the_same_data(haswell, root, tmp_path):
    # Where AVX-512 is missing, a single matrix product by SkylakeX's kernels ends the process.
    assert data(tmp_path / "study", root, OPENBLAS_CORETYPE="SkylakeX") == haswell


def test_functions_with_other_last_bits_make_the_same_data(haswell, root, tmp_path):
    assert data(tmp_path / "study", root, "other-last-bits") == haswell


def test_a_processor_without_avx2_makes_the_same_data(haswell, root, tmp_path):
    older = {
        "OPENBLAS_CORETYPE": "Sandybridge",
        "NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__),
        "OPENCV_IPP": "disabled",
    }
    assert data(tmp_path / "study", root, **older) == haswell

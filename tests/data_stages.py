"""The stages that make data, at their smallest, in the working directory's study and in one process.

Usage: python -m tests.data_stages [other-last-bits]

With ``other-last-bits`` numpy's functions of real numbers give the next larger number, as those of another
processor may.
"""

import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

# With AVX-512 numpy computes these by kernels of its own, whose last bits differ from the C library's.
KERNELS = (
    *(
        "sin",
        "cos",
        "tan",
        "arcsin",
        "arccos",
        "arctan",
        "arctan2",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "exp2",
        "expm1",
    ),
    *("log", "log2", "log10", "log1p", "cbrt", "power", "float_power"),
)
STAGES = (
    "simulate diverse",
    "simulate narrow",
    "film",
    "render",
    "ingest",
    *("split diverse", "split real", "split rendered"),
)


def next_larger(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """``kernel`` with another last bit where its result is a real number."""

    def other(*arguments: Any, **options: Any) -> Any:
        result = kernel(*arguments, **options)
        return result if np.iscomplexobj(result) else np.nextafter(result, np.inf)

    return other


def main() -> None:
    """Run the stages."""
    if sys.argv[1:] == ["other-last-bits"]:
        for name in KERNELS:
            setattr(np, name, next_larger(getattr(np, name)))
    for stage in STAGES:
        name, *arguments = stage.split()
        runpy.run_path(str(Path(__file__).parents[1] / "stages" / f"{name}.py"))["main"](arguments)


if __name__ == "__main__":
    main()

"""Results of invented studies, and the stage that reports on them."""

from tests.stage_outputs import data, full, params, report

__all__ = ["data", "full", "params", "report"]

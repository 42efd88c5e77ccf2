"""Outputs of the stages as tidy tables: every statistic is computed here, once."""

"""Tests of `anyview repro` in toy repositories that know nothing of Anyview."""

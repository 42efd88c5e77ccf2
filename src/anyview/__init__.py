"""Imitation of a task from a video filmed from any viewpoint."""

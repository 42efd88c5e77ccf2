"""Reinforcement learners for many runs in lockstep."""

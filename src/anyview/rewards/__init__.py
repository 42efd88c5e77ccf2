"""Rewards that compare what an agent sees with a demonstration."""

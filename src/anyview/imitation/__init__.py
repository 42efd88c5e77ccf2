"""Rewards, reinforcement learners and the evaluation over many runs."""

"""Whether rewards follow progress and rank failures below successes, by scripted rollouts."""

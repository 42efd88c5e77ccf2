"""The time-contrastive embedding of the `tcn` baseline."""

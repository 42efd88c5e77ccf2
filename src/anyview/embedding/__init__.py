"""The time-contrastive embedding of the `tcn` baseline: network, loss, weights on disk."""

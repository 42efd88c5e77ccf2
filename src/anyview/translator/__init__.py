"""The context translator: network, losses, weights on disk."""

"""The context translator: network, losses, training, evaluation, feature weights."""

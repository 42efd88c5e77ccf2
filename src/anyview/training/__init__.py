"""How networks are trained: batches, optimisation, the loop with its checkpoints."""

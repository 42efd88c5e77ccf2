"""How networks are trained: one loop, what it minimises, batches, optimisation, augmentation."""

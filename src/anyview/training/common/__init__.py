"""What every training shares: the loop, optimisation, batches."""

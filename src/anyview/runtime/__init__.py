"""What every stage needs and none owns: errors, seeds, checkpoints, workers, device, progress."""

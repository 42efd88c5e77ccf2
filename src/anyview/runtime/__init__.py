"""What every stage needs and none owns: errors, outputs, scratch, checkpoints, workers, progress."""

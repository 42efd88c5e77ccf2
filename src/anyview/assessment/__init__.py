"""What a trained translator makes of held-out clips."""

"""What changed between two revisions, and what a sweep of experiments did to the metrics."""

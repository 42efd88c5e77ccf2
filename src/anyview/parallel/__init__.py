"""`anyview repro`: the stages of any DVC repository side by side, on this machine or on a Ray cluster."""

"""Video in and out, sets of clips, manifests and splits."""

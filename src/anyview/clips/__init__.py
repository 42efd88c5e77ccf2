"""Video in and out, manifests, recording, ingest, the surrogate rig, splits and paired sampling."""

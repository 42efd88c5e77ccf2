"""Trained weights for others: policies as ONNX files, methods as model folders on a hub."""

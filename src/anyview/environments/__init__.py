"""The tasks as Gymnasium environments, for other libraries."""

"""The task as Gymnasium environments, for other libraries."""

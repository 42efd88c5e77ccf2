"""The tasks, a module each: see ``anyview.pusher.task``."""

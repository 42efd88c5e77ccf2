"""Imitation of a task from a video filmed from any viewpoint.

Importing it registers the Gymnasium environment ``anyview/Pusher3DoF-v0``.
"""

from gymnasium import register

register(
    "anyview/Pusher3DoF-v0",
    entry_point="anyview.environments.pusher:PusherEnv",
    vector_entry_point="anyview.environments.pusher:PusherVectorEnv",
)

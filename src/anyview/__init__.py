"""Imitation of a task from a video filmed from any viewpoint.

Importing it registers the Gymnasium environments ``anyview/Pusher3DoF-v0``, ``anyview/Reacher3DoF-v0``,
``anyview/Striker3DoF-v0`` and ``anyview/Sweeper3DoF-v0``.
"""

from gymnasium import register

for name, task in (("Pusher", "push"), ("Reacher", "reach"), ("Striker", "strike"), ("Sweeper", "sweep")):
    register(
        f"anyview/{name}3DoF-v0",
        entry_point="anyview.environments.pusher:PusherEnv",
        vector_entry_point="anyview.environments.pusher:PusherVectorEnv",
        kwargs={"task": task},
    )

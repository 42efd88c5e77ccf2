"""Choose a headless OpenGL before a test imports MuJoCo itself."""

import anyview.pusher  # noqa: F401

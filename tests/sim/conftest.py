"""Choose a headless OpenGL before a test imports MuJoCo itself."""

import anyview.sim  # noqa: F401

"""The simulated world of every task: arm and table, contexts, camera and the scripted expert."""

from anyview.runtime.graphics import load_mujoco

load_mujoco()  # before any module here imports mujoco, so that it finds a headless OpenGL

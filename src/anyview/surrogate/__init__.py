"""The surrogate rig: rendered stand-ins for real clips, for a user without webcams.

What rests on them is never called a real result.
"""

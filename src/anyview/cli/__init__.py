"""The command `anyview`, and what stands behind it alone: recording, preview, profiles, doctor."""

"""What the learners share: their interface, noise, replay, stacked networks, policies on disk."""

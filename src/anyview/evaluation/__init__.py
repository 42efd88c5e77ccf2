"""The evaluation of a method: runs in lockstep, each a policy of its own in a context of its own."""

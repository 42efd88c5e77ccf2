"""Rewards that a discriminator learns while the agent does: GAIL and TPIL."""

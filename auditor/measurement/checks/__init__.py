"""The checks: statistics of a frame that an attack on one sensor changes."""

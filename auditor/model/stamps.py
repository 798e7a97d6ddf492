"""Stamps are nanoseconds."""

NANOSECONDS = 10**9
"""So many make a second."""

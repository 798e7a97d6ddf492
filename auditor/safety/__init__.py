"""GUARD: how child processes start, and how much a file of somebody else may unpack to."""

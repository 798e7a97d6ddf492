"""HAND ON: one incident as a folder of files that other tools take, and that a stranger can check."""

"""Versions of calibrations: which is meant, what moves them, and what a change of them changes."""

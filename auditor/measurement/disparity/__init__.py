"""Disparity maps of every pair of sensors in the view of a reference camera."""

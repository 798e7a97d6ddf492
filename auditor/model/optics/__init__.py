"""Geometry of cameras: lenses, poses, and the view that several cameras share."""

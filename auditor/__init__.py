"""Detect and identify optical attacks on cameras and LiDAR in recorded drives."""

__version__ = "0.1.0"

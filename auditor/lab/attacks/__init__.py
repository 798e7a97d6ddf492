"""Attacks and faults on frames of cameras and LiDAR, with their ground truth."""

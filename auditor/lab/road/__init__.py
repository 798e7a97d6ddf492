"""Synthetic road drives, ray-cast: cameras and a LiDAR with true depth."""

from auditor.lab.road.drive import SyntheticDrive, make_drive

__all__ = ["SyntheticDrive", "make_drive"]

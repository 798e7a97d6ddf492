"""Versions of calibrations: how each was made, and which is in force for each rig kind."""

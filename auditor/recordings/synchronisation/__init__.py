"""Frames: the messages of all sensors that belong to one moment."""

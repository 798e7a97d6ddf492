"""Fault features: what tells a sensor's fault from an attack."""

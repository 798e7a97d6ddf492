"""Fault features: numbers that separate a sensor's fault from an attack."""

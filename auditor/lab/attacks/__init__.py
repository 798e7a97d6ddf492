"""Attacks and faults with their ground truth."""

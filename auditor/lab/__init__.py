"""PROVE: attacks and faults on real frames, and synthetic drives."""

"""PROVE: synthetic drives and attacks."""

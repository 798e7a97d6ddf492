"""Synthetic drives."""

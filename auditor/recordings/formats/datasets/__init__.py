"""Drives of published data sets, each read as its publisher laid it out."""

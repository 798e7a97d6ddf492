"""Synthetic drives: streets, vehicles and the data of their sensors."""

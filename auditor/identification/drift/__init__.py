"""Drift: sensors that change from day to day, told from chance by the days of the whole fleet."""

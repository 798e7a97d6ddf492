"""Causes that are not attacks: their scores, and when one explains a finding."""

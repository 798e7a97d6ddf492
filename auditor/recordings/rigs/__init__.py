"""Rigs: found in a recording's camera infos and transforms, or read from files."""

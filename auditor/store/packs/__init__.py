"""Packs: files that hold the rows of many ids, in place of thousands of small ones."""

"""Containers of recordings: a file becomes messages."""

"""The page of a fleet's drift."""

"""READ: a file becomes messages, and messages become frames."""

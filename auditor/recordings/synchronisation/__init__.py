"""Messages of several sensors become frames."""

"""What is done to a whole store: upgraded, its recordings compared, removed, checked."""

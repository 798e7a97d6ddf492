"""What a store knows already: files that it read, and verdicts that would be the same."""

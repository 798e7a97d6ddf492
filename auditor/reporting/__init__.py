"""Pages from a store; no recording is needed to make them."""

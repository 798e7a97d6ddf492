"""MCAP files, read forward with limits on every size."""

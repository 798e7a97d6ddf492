"""MCAP, read forward within bounds."""

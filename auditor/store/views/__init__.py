"""The views for everybody: their comments, their SQL text for the plain DuckDB, and a store opened for a notebook."""

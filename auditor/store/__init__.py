"""KEEP: measurements and verdicts as Parquet, and the SQL that reads them."""

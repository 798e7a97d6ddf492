"""KEEP: measurements and verdicts as Parquet, and the SQL that reads them."""

import pyarrow

# Arrow would take Ctrl-C for itself while it reads or writes, and kill the process with it.
pyarrow.enable_signal_handlers(False)  # noqa: FBT003 - Arrow's signature

"""DuckDB's threads share one object of a file, and each reads by a seek and a read."""

import time
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.store.sandbox.read_only_files import ReadOnlyFile, ReadOnlyFiles

ROWS = 200_000


def test_threads_that_read_one_file_read_their_own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between a seek and its read another thread always has time to seek."""
    path = tmp_path / "frames" / "a.parquet"
    path.parent.mkdir()
    pq.write_table(pa.table({"n": np.arange(ROWS), "text": [str(n) for n in range(ROWS)]}), path, row_group_size=2000)
    seek = ReadOnlyFile.seek

    def slowly(file: ReadOnlyFile, *where: int) -> int:
        place = seek(file, *where)
        time.sleep(0.0001)
        return place

    monkeypatch.setattr(ReadOnlyFile, "seek", slowly)
    files = ReadOnlyFiles()
    [name] = files.names([path])
    with duckdb.connect(config={"threads": 8}) as connection:
        connection.register_filesystem(files)
        rows = f"SELECT sum(n), count(DISTINCT text) FROM read_parquet('{name}')"
        assert connection.execute(rows).fetchall() == [(ROWS * (ROWS - 1) // 2, ROWS)]

"""Arithmetic in SQL gives what Python's gives."""

import math

from auditor.identification.cross_validation import wilson
from auditor.store import run_sql
from tests.making.stores import new_store


def test_wilsons_interval_in_sql_is_pythons_and_stays_within_0_and_1(tmp_path):
    """All k up to n = 60, and the ends and the middle of larger n, where rounding pushes an end out of its place."""
    pairs = [(k, n) for n in range(61) for k in range(n + 1)]
    pairs += [(k, n) for e in range(2, 10) for n in (10**e, 10**e + 7) for k in (0, 1, n // 3, n // 2, n - 1, n)]
    values = ", ".join(f"({k}::BIGINT, {n}::BIGINT)" for k, n in pairs)
    sql = f"SELECT k, n, wilson(k, n, -1) AS low, wilson(k, n, 1) AS high FROM (VALUES {values}) AS pair(k, n)"
    rows = run_sql(new_store(tmp_path), sql).to_pylist()
    assert len(rows) == len(pairs)
    for row in rows:
        if row["n"] == 0:
            assert (row["low"], row["high"]) == (None, None)
            continue
        assert 0 <= row["low"] < row["high"] <= 1, row
        for found, expected in zip((row["low"], row["high"]), wilson(row["k"], row["n"]), strict=True):
            assert math.isclose(found, expected, rel_tol=0, abs_tol=1e-12), row

"""What compares two versions of the program finds every difference, and none where only names and ids changed."""

import pyarrow as pa

from tests.benchmarks import golden_rows
from tests.benchmarks.golden_rows import canonical
from tests.benchmarks.golden_store import compare, keep, read

ROWS = [
    {"frame": f, "x_id": "a", "r": 0.0, "evidence": [{"kind_before": "old", "i": f}], "kind": "clean"} for f in (0, 1)
]


def table(rows):
    schema = {"frame": pa.int64(), "x_id": pa.string(), "r": pa.float64(), "kind": pa.string()}
    evidence = pa.list_(pa.struct([pa.field(name, kind) for name, kind in _evidence(rows)]))
    return pa.Table.from_pylist(rows, pa.schema([*schema.items(), ("evidence", evidence)], metadata={"version": "1"}))


def _evidence(rows):
    return [(name, pa.string() if isinstance(v, str) else pa.int8()) for name, v in rows[0]["evidence"][0].items()]


def found(old, new):
    return list(compare({"verdicts/a.arrow": canonical(old)}, {"verdicts/a.arrow": canonical(new)}))


def test_order_ids_and_metadata_are_no_difference():
    others = [{**row, "x_id": "b"} for row in reversed(ROWS)]
    reordered = table(others).select(["kind", "evidence", "r", "x_id", "frame"]).replace_schema_metadata(None)
    assert found(table(ROWS), reordered) == []


def test_a_changed_value_is_told_by_column_and_number_of_rows():
    changed = [{**ROWS[0], "r": -0.0, "kind": "attacked"}, {**ROWS[1], "kind": "suspect"}]
    assert found(table(ROWS), table(changed)) == [
        "verdicts/a.arrow: column kind differs in 2 of 2 rows",
        "verdicts/a.arrow: column r differs in 1 of 2 rows",
    ]


def test_rows_columns_types_and_files_that_come_or_go_are_told():
    assert found(table(ROWS), table(ROWS[:1])) == ["verdicts/a.arrow: 2 rows in the golden store, 1 now"]
    without = table(ROWS).drop_columns(["kind"])
    assert found(table(ROWS), without) == ["verdicts/a.arrow: column kind is only in the golden store"]
    assert found(without, table(ROWS)) == ["verdicts/a.arrow: column kind is only there now"]
    wider = table(ROWS).set_column(2, "r", pa.array([0.0, 0.0], pa.float32()))
    assert found(table(ROWS), wider) == ["verdicts/a.arrow: column r is float, no longer double"]
    assert list(compare({"a": b"", "b": b""}, {"b": b"", "c": b""})) == [
        "a: only in the golden store",
        "c: only made now",
    ]


def test_what_was_only_renamed_is_equal(tmp_path, monkeypatch):
    keep({"table_before/a.arrow": canonical(table(ROWS))}, tmp_path)
    renamed = [{**row, "evidence": [{"kind_now": "new", "i": row["frame"]}]} for row in ROWS]
    now = {"fault_features/a.arrow": canonical(table(renamed))}
    assert len(list(compare(read(tmp_path), now))) == 2
    for names, new in (("TABLES", ("table_before", "fault_features")), ("FIELDS", ("kind_before", "kind_now"))):
        monkeypatch.setitem(getattr(golden_rows, f"RENAMED_{names}"), *new)
    assert list(compare(read(tmp_path), now)) == ["fault_features/a.arrow: column evidence differs in 2 of 2 rows"]
    monkeypatch.setitem(golden_rows.RENAMED_WORDS, "old", "new")
    assert list(compare(read(tmp_path), now)) == []

"""Answers leave the store with all digits of their times, in every form."""

import csv
import io
import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.errors import QueryError
from auditor.store.export import encode, rows_of
from auditor.store.queries import run_sql
from tests.making.stores import new_store

NS = 1_317_042_145_964_389_445
TEXT = "2011-09-26T13:02:25.964389445Z"


def answer(folder, sql):
    return run_sql(new_store(folder), f"SELECT {sql} AS x")


@pytest.mark.parametrize(
    ("sql", "value"),
    [
        (f"make_timestamp_ns({NS}::BIGINT)", TEXT),
        ("make_timestamp_ns(1317042145000000000::BIGINT)", "2011-09-26T13:02:25.000000000Z"),
        ("make_timestamp_ns(-1::BIGINT)", "1969-12-31T23:59:59.999999999Z"),
        ("NULL::TIMESTAMP_NS", None),
        ("TIMESTAMP '2011-09-26 13:02:25.9'", "2011-09-26T13:02:25.900000Z"),
        ("TIMESTAMPTZ '2011-09-26 13:02:25.9+02'", "2011-09-26T11:02:25.900000Z"),
        ("TIMESTAMP '21000-01-01'", "21000-01-01T00:00:00.000000Z"),
        ("DATE '2011-09-26'", "2011-09-26"),
        ("'01:02:03.123456789'::TIME_NS", "01:02:03.123456789"),
        (f"{{'at': [make_timestamp_ns({NS}::BIGINT), NULL], 'n': 1}}", {"at": [TEXT, None], "n": 1}),
        (f"[make_timestamp_ns({NS}::BIGINT)]::TIMESTAMP_NS[1]", [TEXT]),
        (f"map {{'at': make_timestamp_ns({NS}::BIGINT)}}", [{"key": "at", "value": TEXT}]),
        (f"union_value(at := make_timestamp_ns({NS}::BIGINT))", TEXT),
        ("map {'n': 1}", [("n", 1)]),
        ("[0.5::DOUBLE, NULL]", [0.5, None]),
    ],
)
def test_a_time_is_text_with_every_digit_wherever_it_stands(tmp_path, sql, value):
    table = answer(tmp_path, sql)
    assert rows_of(table) == [{"x": value}]
    assert json.loads(encode(table, "json")) == json.loads(json.dumps([{"x": value}]))


def test_whole_numbers_of_any_size_are_numbers_in_json_and_fixed_points_are_text(tmp_path):
    table = answer(
        tmp_path, "sum(340), 100000000000000000000::HUGEINT AS large, [sum(1)] AS inside, 0.01::DECIMAL(18, 17) AS r, 1"
    )
    [row] = json.loads(encode(table, "json"))
    assert list(row.values()) == [340, 10**20, [1], "0.01000000000000000", 1]


def test_csv_holds_the_same_texts_as_json(tmp_path):
    moment = f"make_timestamp_ns({NS}::BIGINT)"
    table = answer(tmp_path, f"{moment} AS at, [{moment}] AS all, DATE '2011-09-26' AS day, 7")
    [row] = csv.DictReader(io.StringIO(encode(table, "csv").decode()))
    assert row == {"at": TEXT, "all": f'["{TEXT}"]', "day": "2011-09-26", "x": "7"}


def test_parquet_keeps_nanoseconds_as_they_are(tmp_path):
    table = answer(tmp_path, f"make_timestamp_ns({NS}::BIGINT)")
    [column] = pq.read_table(pa.BufferReader(encode(table, "parquet"))).columns
    assert column.type == pa.timestamp("ns")
    assert column.cast(pa.int64()).to_pylist() == [NS]


def test_rows_are_in_their_order_and_none_are_none(tmp_path):
    store = new_store(tmp_path)
    some = run_sql(store, f"SELECT make_timestamp_ns({NS}::BIGINT + x) AS at, x FROM range(3) AS r(x) ORDER BY x DESC")
    assert rows_of(some) == [{"at": f"{TEXT[:-2]}{5 + x}Z", "x": x} for x in (2, 1, 0)]
    assert rows_of(some.slice(0, 0)) == []


@pytest.mark.parametrize(
    ("sql", "text"),
    [
        ("INTERVAL 90 MINUTES", "P0M0DT5400S"),
        ("TIMESTAMP '2011-09-27' - TIMESTAMP '2011-09-26'", "P0M1DT0S"),
        ("INTERVAL '1 year -2 days'", "P12M-2DT0S"),
        ("INTERVAL '-0.000001 seconds'", "P0M0DT-0.000001S"),
        ("NULL::INTERVAL", None),
    ],
)
def test_a_length_of_time_is_text_in_every_form(tmp_path, sql, text):
    table = answer(tmp_path, sql)
    assert rows_of(table) == [{"x": text}]
    assert json.loads(encode(table, "json")) == [{"x": text}]
    assert encode(table, "csv").decode().splitlines()[1:] == ["" if text is None else f'"{text}"']
    assert pq.read_table(pa.BufferReader(encode(table, "parquet"))).to_pylist() == [{"x": text}]


def test_lengths_of_time_inside_lists_and_structs_are_text_too(tmp_path):
    table = answer(tmp_path, "{'a': [INTERVAL 1 DAY]}")
    assert rows_of(table) == [{"x": {"a": ["P0M1DT0S"]}}]
    assert pq.read_table(pa.BufferReader(encode(table, "parquet"))).to_pylist() == [{"x": '{"a": ["P0M1DT0S"]}'}]


def test_texts_of_csv_are_safe_for_a_spreadsheet_and_numbers_stay_numbers(tmp_path):
    cells = "'=1+1' AS a, '-0.5' AS b, -0.5 AS c, ['=1'] AS d, '\u00e9', '=1'::ENUM('=1') AS e, '\\x1B\\x5B'::BLOB AS f"
    [head, row] = list(csv.reader(io.StringIO(encode(answer(tmp_path, f"{cells}, -1"), "csv").decode())))
    assert head == ["a", "b", "c", "d", "'\u00e9'", "e", "f", "x"]
    assert row == ["'=1+1", "-0.5", "-0.5", '["=1"]', "\u00e9", "'=1", "1b5b", "-1"]


def csv_of(*chunks):
    """The cells of one column in CSV, which has these parts."""
    column = pa.chunked_array(chunks)
    table = pa.table({"x": column, "place": range(len(column))})
    return [row[0] for row in list(csv.reader(io.StringIO(encode(table, "csv").decode())))[1:]]


def test_texts_of_csv_have_their_places_in_every_part_of_a_column_missing_ones_too():
    lists = pa.list_(pa.string())
    assert csv_of(pa.array([["\u00e9", None], None], lists), pa.array([[]], lists), pa.array([], lists)) == [
        '["\\u00e9", null]',
        "",
        "[]",
    ]
    assert csv_of(pa.array([b"\x00\xff", None, b""]), pa.array([b"a"])) == ["00ff", "", "", "61"]
    texts = [f"=\u00e9{n}" if n % 3 else None for n in range(20)]
    assert csv_of(pa.array(texts[:9]), pa.array(texts[9:])) == [f"'{text}" if text else "" for text in texts]


def test_csv_of_many_kinds_is_made_without_what_imports_pandas(tmp_path, monkeypatch):
    cells = "'=1+1' AS a, ['=1', NULL] AS b, {'n': [1, 2]} AS c, '\\x1B'::BLOB AS d, NULL::VARCHAR[] AS e, 1.5 AS f"
    table = answer(tmp_path, f"{cells}, map {{'a': 1}}")
    expected = encode(table, "csv")

    def array(*_, **__):
        raise AssertionError("pa.array imports pandas")

    monkeypatch.setattr(pa, "array", array)
    assert encode(table, "csv") == expected
    [_, row] = csv.reader(io.StringIO(expected.decode()))
    assert row == ["'=1+1", '["=1", null]', '{"n": [1, 2]}', "1b", "", "1.5", '[["a", 1]]']


def test_a_type_that_a_form_does_not_have_is_refused_with_a_way_out(tmp_path):
    with pytest.raises(QueryError, match=r"cannot be written as parquet .*cast the column"):
        encode(answer(tmp_path, "union_value(a := 1)"), "parquet")

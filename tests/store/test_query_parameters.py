from decimal import Decimal

import pytest

from auditor.errors import QueryError, StoreError
from auditor.store.sql_files import bind, read_sql_file

HEAD = """-- One question
-- over two lines.
--
-- param r RATE[] = 0, 0.01: Rates.
-- param gap_s DOUBLE = 0.5: A number.
-- param frame BIGINT: A frame: the one to show.
-- param name VARCHAR = NULL: A name.
--
-- column x: The answer.
SELECT 1 AS x
"""


@pytest.fixture
def query(tmp_path):
    (tmp_path / "question.sql").write_text(HEAD)
    return read_sql_file(tmp_path / "question.sql")


def test_a_head_describes_its_query(query):
    assert query.text == "One question over two lines."
    assert [(p.name, p.type, p.required, p.default) for p in query.parameters] == [
        ("r", "RATE[]", False, "0, 0.01"),
        ("gap_s", "DOUBLE", False, "0.5"),
        ("frame", "BIGINT", True, None),
        ("name", "VARCHAR", False, None),
    ]
    assert query.parameters[2].sentence == "A frame: the one to show."
    assert query.columns == {"x": "The answer."}
    assert query.sql == "SELECT 1 AS x"


def test_a_line_that_describes_nothing_is_refused(tmp_path):
    (tmp_path / "question.sql").write_text("-- param r: no type\nSELECT 1")
    with pytest.raises(StoreError, match="describes nothing"):
        read_sql_file(tmp_path / "question.sql")


def test_defaults_stand_in_and_rates_stay_exact(query):
    assert bind(query, {"frame": 3}) == {"r": ["0", "0.01"], "gap_s": 0.5, "frame": 3, "name": None}
    assert bind(query, {"frame": "3", "r": "0.1,1e-3"})["r"] == ["0.1", "0.001"]
    assert bind(query, {"frame": 3, "r": [Decimal("0.05"), 1]})["r"] == ["0.05", "1"]
    assert bind(query, {"frame": 3, "r": 0.01})["r"] == ["0.01"]
    assert bind(query, {"frame": 3, "r": "5%, 0.1 %"})["r"] == ["0.05", "0.001"]


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({}, "frame is missing"),
        ({"frame": "three"}, "frame"),
        ({"frame": 1.5}, "frame"),
        ({"frame": True}, "frame"),
        ({"frame": -1}, "frame is -1, not a whole number of 0 or more"),
        ({"frame": 1, "gap_s": "wide"}, "gap_s"),
        ({"frame": 1, "gap_s": "nan"}, "gap_s"),
        ({"frame": 1, "name": 7}, "name"),
        ({"frame": 1, "r": "0.01,2"}, "r is"),
        ({"frame": 1, "r": "-0.1"}, "r is"),
        ({"frame": 1, "r": "NaN"}, "r is"),
        ({"frame": 1, "r": ""}, "r is"),
        ({"frame": 1, "r": "0.000000000000000001"}, "r is"),
        ({"frame": 1, "colour": "red"}, "no parameter 'colour'"),
    ],
)
def test_a_parameter_that_does_not_fit_is_named(query, given, named):
    with pytest.raises(QueryError, match=named):
        bind(query, given)

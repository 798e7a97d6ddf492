import pyarrow as pa
import pytest

from auditor.errors import StoreError
from auditor.store.schema import arrow_type


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("BIGINT", pa.int64()),
        ("DOUBLE[]", pa.list_(pa.float64())),
        ("VARCHAR[][]", pa.list_(pa.list_(pa.string()))),
        ("DECIMAL(18, 17)", pa.decimal128(18, 17)),
        ("MAP(VARCHAR, BIGINT)", pa.map_(pa.string(), pa.int64())),
        (
            "STRUCT(a TINYINT, m MAP(VARCHAR, BIGINT), s STRUCT(b DOUBLE, c DOUBLE[]))[]",
            pa.list_(
                pa.struct(
                    [
                        ("a", pa.int8()),
                        ("m", pa.map_(pa.string(), pa.int64())),
                        ("s", pa.struct([("b", pa.float64()), ("c", pa.list_(pa.float64()))])),
                    ]
                )
            ),
        ),
    ],
)
def test_sql_types_become_arrow_types(text, expected):
    assert arrow_type(text) == expected


@pytest.mark.parametrize("text", ["", "FLOAT8X", "STRUCT(a TINYINT", "BIGINT []x"])
def test_other_types_are_refused(text):
    with pytest.raises(StoreError, match="no type of a column"):
        arrow_type(text)

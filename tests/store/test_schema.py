import pyarrow as pa
import pytest

from auditor.errors import StoreError
from auditor.resources import resource_folder
from auditor.store.schema import SCHEMA_VERSION, TABLES, arrow_type, table_schema, version_of


def test_there_is_one_file_a_table():
    assert {path.stem for path in resource_folder("schemas").glob("*.toml")} == set(TABLES)


def test_every_table_and_column_has_its_sentence_and_its_files_carry_the_schema_version():
    for table in TABLES:
        schema = table_schema(table)
        assert schema.file.startswith(f"{table}/<")
        for text in (schema.sentence, *(column.sentence for column in schema.columns)):
            assert text[0].isupper() or text.startswith(("sha256", "present", "clean", "b_{")), text
            assert text.endswith("."), text
        assert version_of(schema.arrow) == SCHEMA_VERSION, table


def test_floats_are_split_stamps_are_differences_and_words_have_a_dictionary():
    frames = table_schema("frames")
    assert frames.encodings["stamp_ns"] == "DELTA_BINARY_PACKED"
    assert frames.encodings["skew_ns.list.element"] == "DELTA_BINARY_PACKED"
    assert frames.encodings["saturated_share.list.element"] == "BYTE_STREAM_SPLIT"
    assert set(frames.dictionary_columns) >= {"measurement_id", "state.list.element"}
    assert not set(frames.encodings) & set(frames.dictionary_columns)


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

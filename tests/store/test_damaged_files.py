"""A damaged file of a store is named, whatever DuckDB says of its inside."""

import random
import shutil
from pathlib import Path

import pytest

from auditor.errors import QueryError, StoreError
from auditor.store import Store, run_sandboxed, run_sql
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store, rig = new_store(tmp_path_factory.mktemp("whole")), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)]), "c1u")
    return Path(store.folder)


def damaged(whole: Path, folder: Path, table: str, seed: int) -> tuple[Store, Path]:
    """A copy of the store in which one file's footer has three flipped bits, and that file."""
    copy = Path(shutil.copytree(whole, folder / "audit"))
    [file, *_] = sorted((copy / table).glob("*.parquet"))
    content, rng = bytearray(file.read_bytes()), random.Random(seed)
    footer = int.from_bytes(content[-8:-4], "little")
    for _ in range(3):
        content[len(content) - 8 - rng.randrange(1, footer)] ^= 1 << rng.randrange(8)
    file.write_bytes(bytes(content))
    return Store.open(copy), file


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("table", ["frames", "verdicts"])
def test_a_damaged_file_is_named_with_what_to_do(table: str, seed: int, whole: Path, tmp_path: Path) -> None:
    store, file = damaged(whole, tmp_path, table, seed)
    try:
        run_sql(store, f"SELECT * FROM {table}")
    except StoreError as error:
        assert error.where == str(file)
        assert error.what.startswith("it is damaged and cannot be read (")
        assert "restore it from a copy" in error.remedy
        assert len(str(error).splitlines()) == 1
    # else the bits are of what no reader looks at


def test_at_the_end_of_a_file_it_is_named_in_the_process_of_sql_too(whole: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(whole, tmp_path / "audit"))
    [file, *_] = sorted((copy / "frames").glob("*.parquet"))
    file.write_bytes(file.read_bytes()[:-4] + b"none")
    with pytest.raises(StoreError, match="it is damaged and cannot be read") as caught:
        run_sandboxed(Store.open(copy), "SELECT * FROM frames")
    assert caught.value.where == str(file)


def test_wrong_sql_over_whole_files_is_an_error_of_the_sql(whole: Path) -> None:
    with pytest.raises(QueryError, match="Could not parse string"):
        run_sql(Store.open(whole), "SELECT strptime('x', '%Y'), * FROM frames")

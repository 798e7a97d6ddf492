"""A damaged file of a store is named, whatever DuckDB says of its inside."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from auditor.errors import QueryError, StoreError
from auditor.store.queries import run_sql
from auditor.store.sandbox.process import run_sandboxed
from auditor.store.store import Store
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    store, rig = new_store(tmp_path_factory.mktemp("whole")), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)]), "c1u")
    return Path(store.folder)


def footer(content: bytearray) -> None:
    content[-8 - int.from_bytes(content[-8:-4], "little")] ^= 0xFF


def footer_length(content: bytearray) -> None:
    content[-5] ^= 0xFF


def magic(content: bytearray) -> None:
    content[-1] ^= 0xFF


def pages(content: bytearray) -> None:
    for place in range(4, len(content) - 8 - int.from_bytes(content[-8:-4], "little")):
        content[place] ^= 0xFF


@pytest.mark.parametrize("run", [run_sql, run_sandboxed])
@pytest.mark.parametrize("damage", [footer, footer_length, magic, pages])
@pytest.mark.parametrize("table", ["frames", "verdicts"])
def test_a_damaged_file_is_named_with_what_to_do(
    table: str, damage: Callable[[bytearray], None], run: Callable[..., object], whole: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(whole, tmp_path / "audit"))
    [file, *_] = sorted((copy / table).glob("*.parquet"))
    content = bytearray(file.read_bytes())
    damage(content)
    file.write_bytes(bytes(content))
    with pytest.raises(StoreError, match="it is damaged and cannot be read") as caught:
        run(Store.open(copy), f"SELECT * FROM {table}")
    assert caught.value.where == str(file)
    assert "restore it from a copy" in caught.value.remedy
    assert len(str(caught.value).splitlines()) == 1


def test_wrong_sql_over_whole_files_is_an_error_of_the_sql(whole: Path) -> None:
    with pytest.raises(QueryError, match="Could not parse string"):
        run_sql(Store.open(whole), "SELECT strptime('x', '%Y'), * FROM frames")

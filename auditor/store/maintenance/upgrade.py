"""A store of an earlier schema version, made into one of this version.

The new files are written into a folder inside the store. Then its marker says that they replace the old ones: a store
whose upgrade was killed before that is as it was, and one whose upgrade was killed after it is completed when it is
opened next. No other command may use the store meanwhile.
"""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from auditor.errors import StoreError
from auditor.store.files import close_to_others, finished, locked, make_folder
from auditor.store.folder import UPGRADED, UPGRADED_FROM, move_upgraded, older_version, read_marker, write_marker
from auditor.store.frames_writer import LookedShares
from auditor.store.log.entry import EntryKind, OutputFile, output_of, this_program
from auditor.store.log.runs import run
from auditor.store.packs.index import PackPart, Packs
from auditor.store.schema import MANIFESTS, SCHEMA_VERSION, TABLES, newer_version
from auditor.store.tables import BATCH_ROWS, Row, read_table, write_rows

_Row = dict[str, Any]

_RENAMED = {"single_frame": "alert"}
"""Columns of version 11, by what they are called now."""

_REMARKS_APART = 13
"""The version whose measurements have remarks and looked shares, and whose cases have fewer fault features."""

_FAULT_FEATURES = 19
_NOT_JUDGED = frozenset({0, 6, 10, 11, 18})
"""How many fault features cases of before version 13 have of a pair, and which of them have gone."""

_OF_CASES = ("fault_features", "fault_features_after")

_NO_DOUBT = "lie so far apart, as where only some were recorded, that lost returns"
"""What a warning said before version 13 that is a remark now."""


@dataclass(frozen=True)
class UpgradeResult:
    """What an upgrade did: how many measurements, judgements and parts of evaluations the store has."""

    measurements: int
    judgements: int
    parts: int


def upgrade(folder: Path, command: Sequence[str] | None = None) -> UpgradeResult | None:
    """Upgrade the store in a folder; None where it is of this version already. The log has the command.

    All rows stay, with their ids; columns that the old files lack are NULL, but for how much of each sensor was looked
    at, which its frames say. Tables that the old store lacks are empty. Raises StoreError where the store is of a
    version that cannot be upgraded, or cannot be read or written.
    """
    with locked(folder):
        version = read_marker(folder).version
        close_to_others(folder)  # stores of earlier versions were made as the umask said
        if version == SCHEMA_VERSION:
            move_upgraded(folder)
            return None
        if version > SCHEMA_VERSION:
            raise newer_version(version, folder)
        if version not in UPGRADED_FROM:
            raise older_version(version, folder)
        new = folder / UPGRADED
        shutil.rmtree(new, ignore_errors=True)
        try:
            done = _write(folder, new, version)
        except OSError as error:
            raise StoreError(
                f"the upgraded files cannot be written ({error.strerror or error})",
                where=folder,
                remedy="make room; the store is as it was",
            ) from error
        with run(folder, command or this_program()) as entry, entry.writing(_finished_outputs(new), EntryKind.UPGRADED):
            write_marker(folder, moving=True)
            move_upgraded(folder)
    return done


def _write(old: Path, new: Path, version: int) -> UpgradeResult:
    """Write all tables and pictures of an old store of a version, each into a folder even where it is empty."""
    make_folder(new / "pictures")
    packs = Packs(old)
    for measurement_id in _ids(old, packs, "measurements"):
        if (old / "pictures" / measurement_id).is_dir():
            shutil.copytree(old / "pictures" / measurement_id, new / "pictures" / measurement_id)
    for table in sorted(TABLES, key=lambda table: table not in MANIFESTS):  # a row names the files that it finishes
        make_folder(new / table)
        for row_id in _finished(old, packs, table):
            path = old / table / f"{row_id}.parquet"
            rows = _rows(path if path.is_file() else packs.part(table, row_id) or path)
            if version < _REMARKS_APART and table == "measurements":
                rows = ({**row, **_with_remarks(row), **_looked(new / "frames" / f"{row_id}.parquet")} for row in rows)
            if version < _REMARKS_APART and table == "cases":
                rows = ({**row, **{name: _judged(row[name]) for name in _OF_CASES if name in row}} for row in rows)
            if table in MANIFESTS.values():
                rows = ({**row, "outputs": _outputs(new, table, row_id)} for row in rows)
            write_rows(table, new / table / f"{row_id}.parquet", rows)
        if table in MANIFESTS and not (old / table).is_dir():  # what was not kept then is empty
            for row_id in _ids(old, packs, MANIFESTS[table]):
                write_rows(table, new / table / f"{row_id}.parquet", ())
    count = {table: len(finished(new / table)) for table in TABLES}
    parts = count["evaluations"] + count["object_evaluations"]
    return UpgradeResult(count["measurements"], count["judgements"], parts)


def _looked(frames: Path) -> Row:
    """How much of each sensor was looked at, by the frames of a measurement. Raises StoreError."""
    looked = LookedShares()
    for frame in read_table("frames", frames, ["state", "compared_share", "compared_by_two_share"]).to_pylist():
        if frame["state"] is not None:  # of a skipped tick it is
            looked.add(frame)
    return looked.row


def _with_remarks(measurement: _Row) -> _Row:
    """The warnings of a measurement, and apart from them what casts no doubt on its calibration."""
    said = measurement.get("calibration_warnings") or ()
    return {
        "calibration_warnings": [one for one in said if _NO_DOUBT not in one],
        "remarks": [one for one in said if _NO_DOUBT in one],
    }


def _judged(features: list[float | None] | None) -> list[float | None] | None:
    """The fault features of a case without those that have gone."""
    if features is None:
        return None
    return [value for place, value in enumerate(features) if place % _FAULT_FEATURES not in _NOT_JUDGED]


def _outputs(new: Path, manifest: str, row_id: str) -> list[_Row]:
    """The files that a row of a manifest finishes."""
    files = [new / table / f"{row_id}.parquet" for table, of in MANIFESTS.items() if of == manifest]
    if manifest == "measurements":
        files += sorted((new / "pictures" / row_id).glob("*"))
    return [output_of(file, new).fields for file in files if file.is_file()]


def _finished_outputs(new: Path) -> list[OutputFile]:
    """The files that the log itself has the hashes of: all that no row names."""
    tables = (table for table in TABLES if table not in MANIFESTS)
    return [output_of(path, new) for table in tables for path in sorted((new / table).glob("*.parquet"))]


def _ids(old: Path, packs: Packs, table: str) -> list[str]:
    """The ids of a table that have a file of their own, or rows in a pack."""
    return sorted(packs.ids(table).union(finished(old / table)))


def _finished(old: Path, packs: Packs, table: str) -> list[str]:
    """The ids of a table's finished rows: those that its manifest names, too, where it has one."""
    manifest = MANIFESTS.get(table)
    manifest_ids = set(_ids(old, packs, manifest)) if manifest else None
    return [row_id for row_id in _ids(old, packs, table) if manifest_ids is None or row_id in manifest_ids]


def _rows(place: Path | PackPart) -> Iterator[_Row]:
    """The rows of an old file, or of an id in a pack, marked with this version where rows carry one.

    Raises StoreError.
    """
    path, groups = (place.path, [place.group]) if isinstance(place, PackPart) else (place, None)
    try:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=BATCH_ROWS, row_groups=groups) if groups != [None] else ():
                for old in batch.to_pylist(maps_as_pydicts="strict"):
                    row = {_RENAMED.get(name, name): value for name, value in old.items()}
                    if isinstance(place, PackPart) and row[place.column] != place.row_id:
                        continue
                    yield {**row, "schema_version": SCHEMA_VERSION} if "schema_version" in row else row
    except (OSError, pa.ArrowException) as error:
        raise StoreError(f"it is no readable Parquet file ({error})", where=path) from error

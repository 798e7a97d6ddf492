"""A store of the schema version before, made into one of this version.

The new files are written into a folder inside the store. Then its marker says that they replace the old ones: a store
whose upgrade was killed before that is as it was, and one whose upgrade was killed after it is completed when it is
opened next. No other command may use the store meanwhile.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from auditor.errors import StoreError
from auditor.model.measurement import Procedure, procedure_of
from auditor.store.calibrations import calibration_id, calibration_of
from auditor.store.files import finished, locked
from auditor.store.marker import (
    OLD_TABLES,
    UPGRADED,
    UPGRADED_FROM,
    move_upgraded,
    older_version,
    read_marker,
    write_marker,
)
from auditor.store.records import measurement_id
from auditor.store.schema import SCHEMA_VERSION, TABLES
from auditor.store.store import MANIFESTS
from auditor.store.tables import BATCH_ROWS, newer_version, write_rows

_RENAMED: Mapping[str, Mapping[str, str]] = {
    "pair_checks": {"witness": "check_name"},
    "measurements": {"misfits": "calibration_warnings"},
    "cells": {"against": "inconsistent"},
    "fault_features": {
        "in_step": "row_aligned",
        "late_i": "lagged_i",
        "late_k": "lagged_k",
        "unlike_px": "inconsistent_px",
        "turned": "rotated",
        "turned_only": "rotated_only",
        "unturned_only": "unrotated_only",
        "specks_near": "isolated_near",
        "specks_beyond": "isolated_beyond",
    },
    "judgements": {
        "element_theta": "check_theta",
        "element_scale": "check_scale",
        "element_samples": "check_samples",
    },
    "verdicts": {"margin": "gap"},
    "evaluations": {"stretch": "chunk"},
    "object_evaluations": {"stretch": "chunk"},
    "case_verdicts": {
        "held_out": "left_out",
        "accused": "identified",
        "lasting": "window_kind",
        "lasting_accused": "window_named",
    },
}
"""By table: old name -> new name of columns."""

_WORDS = {
    "contradicted": "lidar_conflict",
    "unlike": "photometric_inconsistency",
    "light": "brightness_difference",
    "empty": "point_dropout",
    "scattered": "isolated_points",
}
"""Old value -> new value of the names of checks."""

_COUNTING_VERSION = 4
_MEASURING, _SYNCHRONISING = "78da6eae4208", "bc27e7641c4b"
"""The digests of what measured and synchronised under that counting version, which measurements now carry."""

_Row = dict[str, Any]


@dataclass(frozen=True)
class Upgraded:
    """What an upgrade did: how many measurements, judgements and parts of evaluations the store has."""

    measurements: int
    judgements: int
    parts: int


def upgrade(folder: Path) -> Upgraded | None:
    """Upgrade the store in a folder; None where it is of this version already.

    Measurements stay valid and get the ids of today's procedures; calibrations get the ids of their new content.
    Judgements keep their ids and verdicts, with judging version 0. Raises StoreError where the store is of a version
    that cannot be upgraded, or cannot be read or written.
    """
    with locked(folder):
        version = read_marker(folder).version
        if version == SCHEMA_VERSION:
            move_upgraded(folder)
            return None
        if version > SCHEMA_VERSION:
            raise newer_version(version, folder)
        if version != UPGRADED_FROM:
            raise older_version(version, folder)
        new = folder / UPGRADED
        shutil.rmtree(new, ignore_errors=True)
        try:
            done = _Upgrade(folder, new).write()
        except OSError as error:
            raise StoreError(
                f"the upgraded files cannot be written ({error.strerror or error})",
                where=folder,
                remedy="make room; the store is as it was",
            ) from error
        write_marker(folder, moving=True)
        move_upgraded(folder)
    return done


class _Upgrade:
    """One upgrade, from the files of `old` to files in `new`."""

    def __init__(self, old: Path, new: Path) -> None:
        self._old, self._new = old, new
        self._measurements: dict[str, str] = {}
        self._calibrations: dict[str, str] = {}

    def write(self) -> Upgraded:
        """Write all tables and pictures, each into a folder of its own even where it is empty."""
        for name in (*TABLES, "pictures"):
            (self._new / name).mkdir(parents=True)
        self._write_measurements()
        self._write_calibrations()
        changes: dict[str, Callable[[_Row], _Row]] = {
            "pair_checks": _with_new_check,
            "judgements": self._judgement,
            "verdicts": self._verdict,
        }
        for table in TABLES:
            if table not in ("measurements", "calibrations"):
                names = self._measurements if MANIFESTS.get(table) == "measurements" else {}
                change = self._measured if names else changes.get(table, _same)
                for row_id, path in self._files(table):
                    write_rows(table, self._place(table, names.get(row_id, row_id)), map(change, _rows(table, path)))
        for old_id, new_id in self._measurements.items():
            if (self._old / "pictures" / old_id).is_dir():
                shutil.copytree(self._old / "pictures" / old_id, self._new / "pictures" / new_id)
        count = {table: len(finished(self._new / table)) for table in TABLES}
        parts = count["evaluations"] + count["object_evaluations"]
        return Upgraded(count["measurements"], count["judgements"], parts)

    def _write_measurements(self) -> None:
        for old_id, path in self._files("measurements"):
            [row] = _rows("measurements", path)
            procedure = _procedure(row)
            new_id = measurement_id(row["recording_id"], row["rig_id"], procedure)
            self._measurements[old_id] = new_id
            row |= {"measurement_id": new_id, **vars(procedure), "schema_version": SCHEMA_VERSION}
            write_rows("measurements", self._place("measurements", new_id), [row])

    def _write_calibrations(self) -> None:
        """Those that can no longer be judged by are left out, as `Store.calibrations` left them out."""
        for old_id, path in self._files("calibrations"):
            rows = [
                {**row, **vars(_procedure(row)), "statistic": _WORDS.get(row["statistic"], row["statistic"])}
                for row in _rows("calibrations", path)
            ]
            with suppress(TypeError, ValueError):
                new_id = calibration_id(calibration_of(rows))
                self._calibrations[old_id] = new_id
                rows = [{**row, "calibration_id": new_id} for row in rows]
                write_rows("calibrations", self._place("calibrations", new_id), rows)

    def _measured(self, row: _Row) -> _Row:
        return {**row, "measurement_id": self._measurements[row["measurement_id"]]}

    def _judgement(self, row: _Row) -> _Row:
        known = self._calibrations.get(row["calibration_id"], row["calibration_id"])
        marks = {"calibration_id": known, "judging_version": 0, "schema_version": SCHEMA_VERSION}
        return {**self._measured(row), **marks}

    def _verdict(self, row: _Row) -> _Row:
        evidence = [
            {
                "check_name": _WORDS.get(one["witness"], one["witness"]),
                **{name: one[name] for name in ("i", "j", "k")},
                "score": one["margin"],
            }
            for one in row["evidence"] or ()
        ]
        return {**self._measured(row), "evidence": evidence}

    def _files(self, table: str) -> Iterator[tuple[str, Path]]:
        """The finished files of a table by their ids."""
        folder = self._old / OLD_TABLES.get(table, table)
        manifest = MANIFESTS.get(table)
        known = set(finished(self._old / manifest)) if manifest else set(finished(folder))
        for row_id in finished(folder):
            if row_id in known:
                yield row_id, folder / f"{row_id}.parquet"

    def _place(self, table: str, row_id: str) -> Path:
        return self._new / table / f"{row_id}.parquet"


def _procedure(row: _Row) -> Procedure:
    """Today's procedure of a row; one of an older counting version stays, since its parameters are not known."""
    old = Procedure(row["matcher"], row["settings"], row["counting_version"])
    if old.counting_version != _COUNTING_VERSION:
        return old
    new = procedure_of(old.matcher, old.settings, measuring=_MEASURING, synchronising=_SYNCHRONISING)
    return replace(new, counting_version=old.counting_version)


def _same(row: _Row) -> _Row:
    return row


def _with_new_check(row: _Row) -> _Row:
    return {**row, "check_name": _WORDS.get(row["check_name"], row["check_name"])}


def _rows(table: str, path: Path) -> Iterator[_Row]:
    """The rows of an old file with today's names of columns. Raises StoreError."""
    names = _RENAMED.get(table, {})
    try:
        with pq.ParquetFile(path) as file:
            for batch in file.iter_batches(batch_size=BATCH_ROWS):
                for row in batch.to_pylist(maps_as_pydicts="strict"):
                    yield {names.get(name, name): value for name, value in row.items()}
    except (OSError, pa.ArrowException) as error:
        raise StoreError(f"it is no readable Parquet file ({error})", where=path) from error

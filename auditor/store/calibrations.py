"""Calibrations: the thresholds artefact, inside a store or as a single file anywhere."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from auditor.errors import StoreError, ThresholdsError
from auditor.results import Calibration, Procedure, Statistic
from auditor.rig import RigKind, Triple
from auditor.store.records import content_id, to_utc
from auditor.store.tables import Row, read_rows, write_rows


def calibration_id(calibration: Calibration) -> str:
    """Hash of everything in a calibration but its id: equal content has equal ids."""
    samples = [
        [statistic.value, *triple, [value.hex() for value in values]]
        for (statistic, triple), values in sorted(calibration.samples.items())
    ]
    procedure = calibration.procedure
    return content_id(
        "calibration",
        rig_kind_fields(calibration.rig_kind),
        [procedure.matcher, procedure.settings, procedure.counting_version],
        sorted(calibration.recordings),
        samples,
    )


def make_calibration(
    rig_kind: RigKind,
    procedure: Procedure,
    recordings: Iterable[str],
    samples: Mapping[tuple[Statistic, Triple], Iterable[float]],
) -> Calibration:
    """A calibration made now, under the id of its content, its samples in ascending order."""
    unnamed = Calibration(
        calibration_id="",
        rig_kind=rig_kind,
        procedure=procedure,
        recordings=tuple(sorted(recordings)),
        samples={key: tuple(sorted(values)) for key, values in samples.items()},
        calibrated_at=datetime.now(UTC),
    )
    return replace(unnamed, calibration_id=calibration_id(unnamed))


def write_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration to a file of its own. Raises StoreError."""
    if calibration.calibration_id != calibration_id(calibration):
        raise StoreError("its id is not that of its content", where=f"calibration {calibration.calibration_id}")
    write_rows("calibrations", path, _rows(calibration))


def read_calibration(path: Path) -> Calibration:
    """Read a calibration from its file. Raises ThresholdsError where it is none, or one of a newer version."""
    try:
        rows = read_rows("calibrations", path)
    except StoreError as error:
        raise ThresholdsError(
            f"it is no calibration: {error.what}", where=path, remedy=error.remedy or "make one with auditor calibrate"
        ) from error
    if not rows:
        raise ThresholdsError("the calibration has no samples", where=path, remedy="make one with auditor calibrate")
    try:
        calibration = _calibration(rows)
    except (TypeError, ValueError) as error:
        raise ThresholdsError(
            f"it is no calibration ({error})", where=path, remedy="make one with auditor calibrate"
        ) from error
    if calibration.calibration_id != calibration_id(calibration):
        raise ThresholdsError(
            "the calibration was changed after it was made", where=path, remedy="make it again with auditor calibrate"
        )
    return calibration


def rig_kind_fields(kind: RigKind) -> dict[str, object]:
    """A rig kind as the STRUCT that `rigs` and `calibrations` hold."""
    return {
        "lidar": kind.lidar,
        "widths_px": [width for width, _ in kind.sizes_px],
        "heights_px": [height for _, height in kind.sizes_px],
        "focals_px": list(kind.focals_px),
        "baselines_m": list(kind.baselines_m),
    }


def _rows(calibration: Calibration) -> Iterator[Row]:
    for (statistic, triple), samples in sorted(calibration.samples.items(), key=_order):
        yield {
            "calibration_id": calibration.calibration_id,
            "kind": str(calibration.rig_kind),
            "rig_kind": rig_kind_fields(calibration.rig_kind),
            "matcher": calibration.procedure.matcher,
            "settings": calibration.procedure.settings,
            "counting_version": calibration.procedure.counting_version,
            "recordings": list(calibration.recordings),
            "calibrated_at": calibration.calibrated_at and to_utc(calibration.calibrated_at),
            "statistic": statistic.value,
            "i": triple.i,
            "j": triple.j,
            "k": triple.k,
            "samples": list(samples),
        }


def _order(item: tuple[tuple[Statistic, Triple], object]) -> tuple[str, int, int, int]:
    """The order of every list: by statistic, then k downwards, then i, then j."""
    (statistic, triple), _ = item
    return statistic.value, -triple.k, triple.i, triple.j


def _calibration(rows: list[dict[str, Any]]) -> Calibration:
    first = rows[0]
    kind = first["rig_kind"]
    return Calibration(
        calibration_id=first["calibration_id"],
        rig_kind=RigKind(
            lidar=kind["lidar"],
            sizes_px=tuple(zip(kind["widths_px"], kind["heights_px"], strict=True)),
            focals_px=tuple(kind["focals_px"]),
            baselines_m=tuple(kind["baselines_m"]),
        ),
        procedure=Procedure(first["matcher"], first["settings"], first["counting_version"]),
        recordings=tuple(first["recordings"]),
        samples={
            (Statistic(row["statistic"]), Triple(row["i"], row["j"], row["k"])): tuple(row["samples"]) for row in rows
        },
        calibrated_at=first["calibrated_at"] and first["calibrated_at"].replace(tzinfo=UTC),
    )

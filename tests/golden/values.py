"""What the golden files hold, worked out anew from real frames; run as a program it writes them.

    python -m tests.golden.values

Do so only where a figure is meant to change, and read the difference before it is kept.
"""

import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any

from auditor.identification.cross_validation import robust_thresholds
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.measurement import FaultFeatures, FrameArrays, measure
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import SensorCheck, rig_sensor_checks
from auditor.model.frames import CameraImage, Frame
from auditor.model.measurement import Measurement, Procedure
from auditor.model.rig import LIDAR, Rig
from auditor.pipeline.judge import Criteria, judge_measurement, system_of
from auditor.store import MeasurementRecord, Store
from auditor.store.queries import run_sql
from tests.benchmarks.real_drives import frames
from tests.making.calibrations import calibrate
from tests.making.stores import NOON

FOLDER = Path(__file__).parent
FRAME, STRETCH = FOLDER / "frame.toml", FOLDER / "stretch.toml"

FRAME_NUMBER = 3
DIGITS = 3
"""Decimals kept of the features: points followed by OpenCV move by millionths from processor to processor."""
WALL = BogusWall(range_m=3.2, lateral_m=0.3)
"""Nearer than the widest pair's matcher can see."""
FACULA = Facula(amplitude=510.0, radius_px=250.0, u_px=600.0, v_px=200.0)
CASES: Mapping[str, Mapping[int, BogusWall | Facula]] = {
    "clean": {},
    "wall": {LIDAR: WALL},
    "facula on S_1": {1: FACULA},
    "facula on S_4": {4: FACULA},
}
CHUNK_FRAMES = range(14, 28)
STANDS_STILL = range(25, 28), 3
"""From the first of these frames on the sensor shows the same image."""
COLUMNS = (
    "frame, e, kind, attacked, named, out_of_system, gap, reason, evidence, alternatives, causes, finding,"
    " finding_attacked"
)
ATTACKED = {
    "facula on S_2": (range(16, 19), 2, FACULA),
    "wall": (range(21, 25), LIDAR, BogusWall(range_m=8.0, lateral_m=0.0)),
}

R = Decimal("0.01")
HIGH_RATE = 5000.0
"""Incidents an hour: so many that the few clean frames can tell them from none."""

Table = dict[str, Any]


def one_frame() -> dict[str, dict[str, Table]]:
    """By case and subject: the counts of each triple, each sensor check's statistic, sums of cells, fault features."""
    rig, stream = frames("0009", all_cameras=True)
    before, frame = islice(stream, FRAME_NUMBER - 1, FRAME_NUMBER + 1)
    _, of_before = measure(before, rig, find_matcher("sgbm"))
    return {name: _figures(of_before, _changed(frame, rig, attacks), rig) for name, attacks in CASES.items()}


def _figures(before: FrameArrays, frame: Frame, rig: Rig) -> dict[str, Table]:
    matcher, watch = find_matcher("sgbm"), FaultFeatures()
    watch.update(before)
    measured, evidence = measure(frame, rig, matcher)
    return {
        "counts": {
            " ".join(map(str, triple)): [
                counts.valid_px,
                counts.inconsistent_px,
                counts.gated_valid_px,
                counts.gated_inconsistent_px,
                counts.out_of_range_px,
            ]
            for triple, counts in zip(rig.measured_triples, measured.counts, strict=True)
            if counts is not None
        },
        "statistics": {
            _named(check): value
            for check, value in zip(rig_sensor_checks(rig), _statistics(measured, rig), strict=True)
            if value is not None
        },
        "cells": {
            f"{of.check.value} {of.i} {of.k} on {of.sensor}": [int(one.valid.sum()), int(one.total.sum())]
            for of, one in measured.cells.items()
        },
        "features": {
            " ".join(map(str, pair)): [[round(value, DIGITS) for value in part] for part in features]
            for pair, features in watch.update(evidence).items()
        },
    }


def one_stretch() -> dict[str, Any]:
    """Some frames of a drive, attacks and a fault among them, as the clean frames of another drive have them judged."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store.open(Path(folder) / "audit", create=True)
        rig, stream = frames("0001", all_cameras=True)
        clean = _measured(store, rig, stream, "a")
        rig, stream = frames("0009", all_cameras=True)
        audited = _measured(store, rig, _stretch(stream, rig), "b")
        calibration = calibrate([(store, clean)])
        judge_measurement(store, audited, calibration, Criteria(R))
        rows = run_sql(store, f"SELECT {COLUMNS} FROM verdicts ORDER BY frame").to_pylist()
        thresholds = robust_thresholds(calibration, system_of(rig), R, HIGH_RATE)
    return {
        "score": thresholds.score,
        "thresholds": {
            _named(check): [one.mean, one.deviation, one.drives, one.samples]
            for check, one in thresholds.expected.items()
        },
        "causes": {
            " ".join(str(part) for part in cause if part is not None): [scale.theta, scale.scale, scale.drives]
            for cause, scale in thresholds.causes.items()
        },
        "limit": thresholds.limit,
        "frames": [_readable(row) for row in rows],
    }


def _stretch(stream: Iterator[Frame], rig: Rig) -> Iterator[Frame]:
    still, sensor = STANDS_STILL
    kept: dict[int, CameraImage] = {}
    for frame in islice(stream, CHUNK_FRAMES.start, CHUNK_FRAMES.stop):
        if frame.number in still:
            kept.setdefault(sensor, frame.images[sensor])
        seen = replace(frame, images={**frame.images, **kept})
        yield _changed(seen, rig, {s: attack for during, s, attack in ATTACKED.values() if frame.number in during})


def _changed(frame: Frame, rig: Rig, attacks: Mapping[int, BogusWall | Facula]) -> Frame:
    images, cloud = dict(frame.images), frame.cloud
    for sensor, attack in attacks.items():
        if isinstance(attack, Facula):
            images[sensor] = attack.apply(images[sensor])
        else:
            assert cloud is not None
            cloud = attack.apply(cloud, rig)
    return replace(frame, images=images, cloud=cloud)


def _measured(store: Store, rig: Rig, stream: Iterator[Frame], recording: str) -> str:
    matcher, watch = find_matcher("sgbm"), FaultFeatures()
    procedure = Procedure(matcher.name, matcher.settings)
    record = MeasurementRecord(recording * 64, rig.rig_id, procedure, (), {}, NOON, seconds=1.0)
    store.write_rig(rig)
    with store.frames_writer(record.measurement_id, rig) as writer:
        for frame in stream:
            measured, evidence = measure(frame, rig, matcher)
            writer.add(replace(measured, fault_features=watch.update(evidence)), _statistics(measured, rig))
        writer.commit(record)
    return record.measurement_id


def _statistics(measured: Measurement, rig: Rig) -> tuple[float | None, ...]:
    return sensor_statistics(rig_sensor_checks(rig), measured.cells, measured.shares)


def _named(check: SensorCheck) -> str:
    return f"{check.check.value} {check.sensor} by {' '.join(map(str, check.others))}"


def _readable(row: Mapping[str, object]) -> Table:
    """A verdict without what is NULL in it; structures become lists of their values, sensors and words first."""
    return {name: _plain(value) for name, value in row.items() if value is not None}


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return [_plain(part) for part in value.values() if part is not None]
    return [_plain(part) for part in value] if isinstance(value, list) else value


def read(path: Path) -> dict[str, Any]:
    """What a golden file holds."""
    return tomllib.loads(path.read_text())


def _section(head: str, table: Mapping[str, object]) -> str:
    return f"\n{head}\n" + "".join(_line(name, value) for name, value in table.items())


def _line(name: str, value: object) -> str:
    key = name if name.isidentifier() else f'"{name}"'
    return f"{key} = {_toml(value)}\n"


def _toml(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _write() -> None:
    figures, chunk = one_frame(), one_stretch()
    FRAME.write_text(
        f"# Frame {FRAME_NUMBER} of KITTI drive 0009 with four cameras, clean and attacked.\n"
        "# counts: valid, inconsistent, valid with texture, inconsistent with texture, nearer than the matcher sees.\n"
        "# cells: by pair, and the sensor whose grid it is, the sums over it: valid, and inconsistent or light.\n"
        "# features: rows, agreement with the LiDAR and isolated points, in the order of their fields.\n"
        + "".join(
            _section(f'["{case}".{subject}]', table)
            for case, tables in figures.items()
            for subject, table in tables.items()
        )
    )
    STRETCH.write_text(
        f"# Frames {CHUNK_FRAMES.start} to {CHUNK_FRAMES[-1]} of KITTI drive 0009, judged at r = {R} by drive 0001.\n"
        "# thresholds: mean, deviation, drives and frames; causes: theta, scale, drives.\n"
        + "".join(f"# {name}: frames {during.start} to {during[-1]}\n" for name, (during, *_) in ATTACKED.items())
        + f"# S_{STANDS_STILL[1]} stands still: frames {STANDS_STILL[0].start} to {STANDS_STILL[0][-1]}\n\n"
        + _line("score", chunk["score"])
        + _line("limit", chunk["limit"])
        + _section("[thresholds]", chunk["thresholds"])
        + _section("[causes]", chunk["causes"])
        + "".join(_section("[[frames]]", verdict) for verdict in chunk["frames"])
    )


if __name__ == "__main__":
    _write()

"""What the golden file holds, worked out anew from real frames; run as a program it writes it.

    python -m tests.golden.values

Do so only where a figure is meant to change. A digest says that something changed, and not what: print `figures` or
`judged` of before and after, where that is the question.
"""

import hashlib
import json
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
from auditor.store.queries import run_sql
from auditor.store.records import MeasurementRecord
from auditor.store.store import Store
from tests.benchmarks.real_drives import frames
from tests.making.calibrations import calibrate
from tests.making.stores import NOON

GOLDEN = Path(__file__).with_name("golden.toml")

FRAME_NUMBER = 3
DIGITS = 3
"""Decimals kept: points followed by OpenCV move by millionths from processor to processor, sums by less."""
JUDGED_DIGITS = 2
"""Of 1,384 figures none is nearer than 2e-6 to where it would be rounded the other way."""
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


def one_frame() -> dict[str, Table]:
    """By case: a digest of each subject's figures."""
    return {
        case: {subject: digest(table, DIGITS) for subject, table in subjects.items()}
        for case, subjects in figures().items()
    }


def one_stretch() -> Table:
    """The limit, the kinds of all verdicts and their gaps, and digests of the thresholds and of all that was judged."""
    of_all = judged()
    rows = of_all["frames"]
    return {
        "limit": round(of_all["limit"], JUDGED_DIGITS),
        "kinds": " ".join(row["kind"] for row in rows),
        "attacked": [row["attacked"] for row in rows],
        "gaps": [round(row["gap"], JUDGED_DIGITS) for row in rows],
        **{name: digest(of_all[name], JUDGED_DIGITS) for name in ("thresholds", "causes", "frames")},
    }


def figures() -> dict[str, dict[str, Table]]:
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
            " ".join(map(str, pair)): [list(part) for part in features]
            for pair, features in watch.update(evidence).items()
        },
    }


def judged() -> dict[str, Any]:
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
        "score": thresholds.evidence_limit,
        "thresholds": {
            _named(check): [one.mean, one.deviation, one.drives, one.samples]
            for check, one in thresholds.expected.items()
        },
        "causes": {
            " ".join(str(part) for part in cause if part is not None): [scale.theta, scale.scale, scale.drives]
            for cause, scale in thresholds.causes.items()
        },
        "limit": thresholds.limit,
        "frames": rows,
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


def digest(value: object, digits: int) -> str:
    """Twelve digits that follow from a nested value; its floats are rounded to so many decimals."""
    return hashlib.sha256(json.dumps(_rounded(value, digits)).encode()).hexdigest()[:12]


def _rounded(value: object, digits: int) -> object:
    if isinstance(value, dict):
        return {name: _rounded(part, digits) for name, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part, digits) for part in value]
    return round(value, digits) + 0.0 if isinstance(value, float) else value  # -0.0 becomes 0.0


def read() -> dict[str, Any]:
    """What the golden file holds."""
    return tomllib.loads(GOLDEN.read_text())


def _write() -> None:
    tables = {**{f'frame."{name}"': figures for name, figures in one_frame().items()}, "stretch": one_stretch()}
    sections = (
        f"[{head}]\n" + "".join(f"{name} = {json.dumps(value)}\n" for name, value in table.items())
        for head, table in tables.items()
    )
    GOLDEN.write_text("\n".join(sections))


if __name__ == "__main__":
    _write()

"""An evaluation gives each attack the verdict that a scan gives a recording that is attacked alike."""

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.lab.evaluation import EvaluateTask, RecordingSource, evaluate_source, experiments_of, judge_cases, runner
from auditor.lab.evaluation.experiments import DELAYS, Attacks, Experiment, SeededDraws
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.pipeline.judge import Criteria, judge_measurement
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from auditor.store.queries import run_sql
from auditor.store.store import Store
from tests.benchmarks.real_drives import frames
from tests.making.calibrations import calibrate

R = Decimal("0.01")
APART = 12
"""Frames attacked in one copy lie so far apart that no verdict depends on two of them, and no incident."""

_HARDLY_EVER = 10**6
"""Of recordings that give thresholds the clean frames are needed alone."""


@dataclass(frozen=True)
class Judged:
    """The verdict on a frame under some attacks."""

    kind: str
    attacked: tuple[int, ...]
    causes: tuple[tuple[str, int | None, float], ...]
    finding: str | None
    finding_attacked: tuple[int, ...]


@dataclass(frozen=True)
class Compared:
    """One attacked frame: the attacks, and both verdicts."""

    experiment: str
    frame: int
    attacked: tuple[int, ...]
    attack: str
    evaluated: Judged
    scanned: Judged


@dataclass(frozen=True)
class _Case:
    experiment: Experiment
    frame: int
    attacks: Attacks
    key: tuple[object, ...]


def compare(
    folder: Path,
    clean: Path,
    others: Sequence[Path],
    experiments: Sequence[Experiment],
    *,
    every: int,
    patterns: tuple[Path, ...],
) -> Iterator[Compared]:
    """Every attacked frame of a clean recording, by thresholds of others.

    Cases of the experiments are taken, which `evaluate` tries: of each `every`-th frame. Those that are not judged by
    all sensors are left out: that is how a scan judges.
    """
    store = folder / "evaluated"
    for path, attack_every in ((clean, every), *((other, _HARDLY_EVER) for other in others)):
        task = EvaluateTask(RecordingSource(path), store, attack_every=attack_every, patterns=patterns)
        evaluate_source(task, lambda *_: None)
    judge_cases(Store.open(store))
    with RecordingSource(clean).open() as (drive,):
        rig, frames = drive.rig, [frame for frame in drive.frames if isinstance(frame, Frame)]
        evaluated = _evaluated(Store.open(store), drive.recording_id, rig)
        seed = int(drive.recording_id[:8], 16)
    scans = folder / "scanned"
    known = [measure_recording(MeasureTask(other, scans), lambda *_: None).measurement_ids[0] for other in others]
    calibration = calibrate([(Store.open(scans), measurement) for measurement in known])
    judged: dict[str, list[_Case]] = {}
    for number, everything in enumerate(_copies(frames, rig, seed, experiments, every)):
        copy = [case for case in everything if case.key in evaluated]
        if not copy:
            continue
        path = folder / f"copy {number}.mcap"
        write_mcap(path, rig, _attacked(frames, rig, copy), image="raw", compression="none")
        measured = measure_recording(MeasureTask(path, scans), lambda *_: None).measurement_ids[0]
        judged[judge_measurement(Store.open(scans), measured, calibration, Criteria(R)).judgement_id] = copy
        path.unlink()
    scanned = _scanned(Store.open(scans), judged)
    for judgement, copy in judged.items():
        for case in copy:
            names = " and ".join(sorted({attack.name for attack in case.attacks.values()}))
            attacked, verdicts = tuple(sorted(case.attacks)), (evaluated[case.key], scanned[judgement, case.frame])
            yield Compared(case.experiment.name, case.frame, attacked, names, *verdicts)


_SAME_SCORE = 0.01


def same(one: Judged, other: Judged) -> bool:
    """True for equal verdicts with the same causes, whose scores differ by no more than a hundredth.

    What is usual of a drive follows from its own frames, and in a scan the attacked one is among them.
    """
    pairs = zip(one.causes, other.causes, strict=False)
    close = all(a[:2] == b[:2] and abs(a[2] - b[2]) < _SAME_SCORE for a, b in pairs)
    return close and len(one.causes) == len(other.causes) and replace(one, causes=()) == replace(other, causes=())


def _copies(
    frames: Sequence[Frame], rig: Rig, seed: int, experiments: Sequence[Experiment], every: int
) -> Iterator[list[_Case]]:
    """The cases in the fewest possible copies: each frame, or each interval, is attacked once in a copy."""
    for experiment in experiments:
        if not experiment.attacks or set(experiment.triples(rig)) != set(rig.measured_triples):
            continue
        by_number: dict[tuple[int, int], list[_Case]] = defaultdict(list)
        for at, frame in enumerate(frames):
            if experiment.takes(frame.number, every):
                past = frames[max(at - max(DELAYS), 0) : at]
                cases = experiment.cases(rig, SeededDraws(0, seed, frame.number, 0), past)
                for number, case in enumerate(cases):
                    key = experiment.name, frame.number, case.attacked, case.attack, case.strength, case.size
                    copy = number, 0 if experiment.together > 1 else at % APART
                    by_number[copy].append(_Case(experiment, frame.number, case.attacks, key))
        yield from by_number.values()


def _attacked(frames: Sequence[Frame], rig: Rig, copy: Sequence[_Case]) -> Iterator[Frame]:
    attacks_on = {case.frame: case.attacks for case in copy}
    for frame in frames:
        attacks = attacks_on.get(frame.number, {})
        images = {s: attacks[s].apply(image) if s in attacks else image for s, image in frame.images.items()}
        # Delayed data keep the stamp of their frame: an attack changes data, not their time.
        images = {s: replace(image, stamp_ns=frame.images[s].stamp_ns) for s, image in images.items()}
        cloud = frame.cloud
        if LIDAR in attacks and cloud is not None:
            cloud = replace(attacks[LIDAR].apply(cloud, rig), stamp_ns=cloud.stamp_ns)
        yield replace(frame, images=images, cloud=cloud)


def _evaluated(store: Store, recording_id: str, rig: Rig) -> dict[tuple[object, ...], Judged]:
    sql = f"SELECT * FROM case_verdicts WHERE left_out = 'recording' AND recording_id = '{recording_id}'"
    rows = [row for row in run_sql(store, sql).to_pylist() if tuple(row["system"]) == rig.sensors]
    return {
        tuple(tuple(row[name]) if name == "attacked" else row[name] for name in _KEY): _judged(
            row["verdict"], row["identified"], row["causes"], row["window_kind"], row["window_named"]
        )
        for row in rows
        if row["attacked"]
    }


_KEY = ("experiment", "frame", "attacked", "attack", "strength", "size")


def _scanned(store: Store, judgement_ids: Iterable[str]) -> dict[tuple[str, int], Judged]:
    """By judgement and frame. An evaluation tells of no event of a single frame."""
    event = "CASE WHEN NOT alert THEN finding END, CASE WHEN NOT alert THEN finding_attacked END AS named"
    columns = f"judgement_id, frame, kind, attacked, causes, {event}"
    sql = f"SELECT {columns} FROM verdicts WHERE judgement_id IN ({', '.join(map(repr, judgement_ids))})"
    rows = (list(row.values()) for row in run_sql(store, sql).to_pylist())
    return {(judgement, frame): _judged(*row) for judgement, frame, *row in rows}


def _judged(
    kind: str,
    attacked: Sequence[int],
    causes: Sequence[dict[str, object]],
    finding: str | None,
    finding_attacked: Sequence[int] | None,
) -> Judged:
    found = tuple((one["cause"], one["sensor"], one["score"]) for one in causes)
    return Judged(kind, tuple(attacked), found, finding, tuple(finding_attacked or ()))


FRAMES, ATTACKED = 3, 1
"""The frame attacked alone has one before and one after it."""

pytestmark = pytest.mark.skipif("AUDITOR_TEST_DATA" not in os.environ, reason="needs AUDITOR_TEST_DATA")


def one_of_each_kind(experiment):
    """The experiment on one frame or interval, but each kind of attack once on the LiDAR and once on a camera."""

    def cases(rig, draws, past):
        found = {}
        for case in experiment.cases(rig, draws, past):
            wanted = case.attacked in ((0,), (1,)) and (draws.frame == ATTACKED or experiment.together > 1)
            if wanted or not experiment.attacks:
                found[case.attacked, case.attack, case.strength in ("bright", "moving")] = case
        return iter(found.values())

    return replace(experiment, cases=cases)


@pytest.fixture
def few_attacks(monkeypatch):
    """The experiments that are tried, with few cases each."""
    pattern = next((Path(os.environ["AUDITOR_TEST_DATA"]) / "laser_patterns").rglob("*.png"))
    chosen = [one_of_each_kind(one) for one in experiments_of((pattern,)) if one.name != "sensitivity"]
    monkeypatch.setattr(runner, "experiments_of", lambda patterns: tuple(chosen))
    return chosen


def halved(rig, frames):
    """The rig and frames with half of the rows and columns: attacks are of as many pixels as they are of whole ones."""
    half = np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]])
    cameras = [
        replace(one, width_px=one.width_px // 2, height_px=one.height_px // 2, projection=half @ one.projection)
        for one in rig.cameras
    ]

    def smaller(number, image):
        size_px = cameras[number - 1].width_px, cameras[number - 1].height_px
        return replace(image, pixels=cv2.resize(image.pixels, size_px, interpolation=cv2.INTER_AREA))

    made = (replace(one, images={n: smaller(n, image) for n, image in one.images.items()}) for one in frames)
    return Rig(rig.lidar, tuple(cameras)), made


def test_an_evaluation_and_a_scan_say_the_same_of_every_kind_of_attack(tmp_path, few_attacks):
    paths = []
    for number, first in (("0009", 0), ("0001", 0), ("0001", 8)):
        rig, stream = frames(number, colour=True)
        paths.append(tmp_path / f"{number} from {first}.mcap")
        write_mcap(paths[-1], *halved(rig, islice(stream, first, first + FRAMES)), image="raw")
    clean, *others = paths
    found = list(compare(tmp_path, clean, others, few_attacks, every=1, patterns=()))
    assert [one for one in found if not same(one.evaluated, one.scanned)] == []
    assert {one.experiment for one in found} == {"combinations", "further", "intervals", "patterns"}
    assert {one.evaluated.kind for one in found} >= {"attacked", "clean"}
    assert any(one.evaluated.causes for one in found)
    assert {one.evaluated.finding for one in found} >= {"attacked", None}

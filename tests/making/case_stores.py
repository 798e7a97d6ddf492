"""Attacked recordings with their store, for the tests of pictures and cases.

They are really measured; their verdicts are written by hand, so that no change of the judge changes these incidents.
"""

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from auditor.model.checks import Check
from auditor.model.frames import Frame, Pose
from auditor.model.pictures import Pictures
from auditor.model.verdict import Evidence, Finding, Verdict, VerdictKind
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.pipeline.pictures import picture_incidents
from auditor.recordings import open_recording, survey, synchronise, write_mcap
from auditor.recordings.rigs.discovery import find_rigs
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.records import JudgementRecord
from auditor.store.store import Store
from tests.making.report_stores import RULES, WHEN, robust_judging
from tests.making.scenes import plane_rig
from tests.making.small_drives import DAY_NS, FOUR_CAMERAS, START_NS, drive_frames

NAMES = {0: "Nachtfahrt Zebra.mcap", 2: "Tagfahrt Gnu.mcap"}
VEHICLE = "Prototyp Quitte"
FRAMES = 12
ATTACKED = range(5, 9)
_EVIDENCE = {0: Check.LIDAR_CONFLICT, 2: Check.ADDED_LIGHT}


def place(stamp_ns: int) -> Pose:
    """The vehicle drives north-east."""
    seconds = (stamp_ns - START_NS) % DAY_NS / 1e9
    return Pose("gps", 49.0 + seconds * 1e-4, 8.4 + seconds * 1e-4, 115.0)


_ANSWERS: dict[tuple[str, tuple[tuple[str, int], ...]], list[dict[str, Any]]] = {}


@dataclass(frozen=True)
class AttackedStore:
    """A store and the recordings that it was made of, by the sensor that is attacked in each."""

    recordings: Mapping[int, Path]
    folder: Path

    @property
    def store(self) -> Store:
        return Store.open(self.folder)

    def ask(self, sql: str) -> list[dict[str, Any]]:
        """The rows of an answer: many tests ask of copies of one store what others have asked, with the same files."""
        found = sorted(self.folder.rglob("*.parquet"))
        asked = sql, tuple((str(path.relative_to(self.folder)), path.stat().st_mtime_ns) for path in found)
        if asked not in _ANSWERS:
            _ANSWERS[asked] = rows_of(run_sql(self.store, sql))
        return [dict(row) for row in _ANSWERS[asked]]

    def row(self, sensor: int) -> dict[str, Any]:
        """The longest incident that names a sensor."""
        return max((row for row in self.ask("FROM incidents") if sensor in row["attacked"]), key=lambda r: r["frames"])

    def incident(self, sensor: int) -> str:
        """The id of the longest incident that names a sensor."""
        return str(self.row(sensor)["incident_id"])

    def region(self, frame: int) -> dict[str, Any]:
        """The damaged portion of the LiDAR in a frame of the drive in which it is attacked."""
        known = self.row(0)["measurement_id"]
        return self.ask(f"FROM regions WHERE measurement_id = '{known}' AND frame = {frame} AND sensor = 0")[0]

    def copied(self, folder: Path) -> "AttackedStore":
        """A copy of the store that a test may change; the recordings are where they were."""
        return AttackedStore(self.recordings, Path(shutil.copytree(self.folder, folder / "audit")))


def attacked_store(folder: Path) -> AttackedStore:
    """In one drive S_0 sees a wall, in another S_2 is blinded; with GPS fixes, and with names that are easily found."""
    rig, recordings = plane_rig(FOUR_CAMERAS, lidar=True), {}
    (folder / "Ordner Quagga").mkdir()
    store = Store.open(folder / "audit", create=True)
    for day, (sensor, name) in enumerate(NAMES.items()):
        start_ns, path = START_NS + day * DAY_NS, folder / "Ordner Quagga" / name
        frames = drive_frames(rig, FRAMES, seed=3, start_ns=start_ns, attacked={sensor: ATTACKED})
        write_mcap(path, rig, frames, vehicle=VEHICLE, place=place)
        [known] = measure_recording(MeasureTask(path, store.folder), lambda *_: None).measurement_ids
        judge_by_hand(store, known, sensor)
        recordings[sensor] = path
    measured = [one.measurement_id for one in store.measurements()]
    assert [one.remark for one in picture_incidents(store, measured, Pictures.ALL, limits_by_size())] == ["", ""]
    return AttackedStore(recordings, folder / "audit")


def judge_by_hand(
    store: Store, measurement_id: str, sensor: int, attacked: range = ATTACKED, r: str = "0.01", when: datetime = WHEN
) -> None:
    """Every frame in which the sensor is attacked is found, the last but one as the strongest."""
    _, thresholds = robust_judging(store.rig(store.measurement(measurement_id).rig_id), r, 2)  # type: ignore[no-untyped-call]
    evidence = (Evidence(_EVIDENCE[sensor].value, sensor, None, None, 5.0),)
    finding = Finding(VerdictKind.ATTACKED, (sensor,))
    rows = []
    stored = store.load_statistics(measurement_id)
    for frame, stamp_ns in zip(stored.frames.tolist(), stored.stamps_ns.tolist(), strict=True):
        verdict = Verdict(VerdictKind.CLEAN, "", gap=3.0)
        if frame in attacked:
            gap = 2.0 + (frame == attacked[-2])
            verdict = Verdict(
                VerdictKind.ATTACKED, "", (sensor,), gap=gap, evidence=evidence, finding=finding, posterior=0.9
            )
        rows.append((frame, stamp_ns, verdict))
    store.write_judgement(JudgementRecord(measurement_id, "robust", thresholds, RULES, when), rows)


def recorded_frames(path: Path) -> dict[int, Frame]:
    """The frames of a recording by their numbers."""
    with open_recording(path) as recording:
        known = survey(recording)
        stream = synchronise(recording, find_rigs(known)[0], known, colour=True)
        return {item.number: item for item in stream if isinstance(item, Frame)}

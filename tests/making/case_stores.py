"""An attacked recording with its store, for the tests of pictures and cases: measured and judged once."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auditor.cli import run
from auditor.model.frames import Frame
from auditor.model.poses import Pose
from auditor.recordings import open_recording, survey, synchronise, write_mcap
from auditor.recordings.rigs.discovery import find_rigs
from auditor.store import Store, rows_of, run_sql
from tests.making.scenes import plane_rig
from tests.making.small_drives import FOUR_CAMERAS, START_NS, drive_frames

NAME, VEHICLE = "Nachtfahrt Zebra.mcap", "Prototyp Quitte"
FRAMES = 24
ATTACKED = {2: range(6, 11), 0: range(15, 20)}


def place(stamp_ns: int) -> Pose:
    """The vehicle drives north-east."""
    seconds = (stamp_ns - START_NS) / 1e9
    return Pose("gps", 49.0 + seconds * 1e-4, 8.4 + seconds * 1e-4, 115.0)


@dataclass(frozen=True)
class AttackedStore:
    """A store and the recording that it was made of."""

    recording: Path
    folder: Path

    @property
    def store(self) -> Store:
        return Store.open(self.folder)

    def ask(self, sql: str) -> list[dict[str, Any]]:
        return rows_of(run_sql(self.store, sql))

    def incident(self, sensor: int) -> str:
        """The id of the longest incident that names a sensor."""
        rows = self.ask(f"FROM incidents WHERE list_contains(attacked, {sensor}) ORDER BY frames DESC")
        return str(rows[0]["incident_id"])

    def copied(self, folder: Path) -> "AttackedStore":
        """A copy of the store that a test may change; the recording is where it was."""
        return AttackedStore(self.recording, Path(shutil.copytree(self.folder, folder / "audit")))


def attacked_store(folder: Path) -> AttackedStore:
    """S_2 is blinded, then S_0 sees a wall; with GPS fixes, and with names that are found wherever they stand."""
    path = folder / "Ordner Quagga" / NAME
    path.parent.mkdir()
    frames = drive_frames(plane_rig(FOUR_CAMERAS, lidar=True), FRAMES, seed=3, attacked=ATTACKED)
    write_mcap(path, plane_rig(FOUR_CAMERAS, lidar=True), frames, vehicle=VEHICLE, place=place)
    assert run(["scan", str(path), "--store", str(folder / "audit"), "--jobs", "1"]) == 1
    return AttackedStore(path, folder / "audit")


def recorded_frames(path: Path) -> dict[int, Frame]:
    """The frames of a recording by their numbers."""
    with open_recording(path) as recording:
        known = survey(recording)
        stream = synchronise(recording, find_rigs(known)[0], known, colour=True)
        return {item.number: item for item in stream if isinstance(item, Frame)}

"""An attacked recording with its store, for the tests of pictures and cases: measured and judged once."""

import shutil
from collections.abc import Mapping
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
from tests.making.small_drives import DAY_NS, FOUR_CAMERAS, START_NS, drive_frames

NAMES = {0: "Nachtfahrt Zebra.mcap", 2: "Tagfahrt Gnu.mcap"}
VEHICLE = "Prototyp Quitte"
FRAMES, CLEAN_FRAMES = 14, 20
ATTACKED = range(5, 10)


def place(stamp_ns: int) -> Pose:
    """The vehicle drives north-east."""
    seconds = (stamp_ns - START_NS) % DAY_NS / 1e9
    return Pose("gps", 49.0 + seconds * 1e-4, 8.4 + seconds * 1e-4, 115.0)


@dataclass(frozen=True)
class AttackedStore:
    """A store and the recordings that it was made of, by the sensor that is attacked in each."""

    recordings: Mapping[int, Path]
    folder: Path

    @property
    def store(self) -> Store:
        return Store.open(self.folder)

    def ask(self, sql: str) -> list[dict[str, Any]]:
        return rows_of(run_sql(self.store, sql))

    def row(self, sensor: int) -> dict[str, Any]:
        """The longest incident that names a sensor."""
        return self.ask(f"FROM incidents WHERE list_contains(attacked, {sensor}) ORDER BY frames DESC")[0]

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
    clean, store = folder / "Ordner Quagga" / "Probefahrt Emu.mcap", str(folder / "audit")
    write_mcap(clean, rig, drive_frames(rig, CLEAN_FRAMES, seed=3, start_ns=START_NS - DAY_NS))
    run(["calibrate", str(clean), "--store", store, "--jobs", "1"])
    for day, (sensor, name) in enumerate(NAMES.items()):
        start_ns, path = START_NS + day * DAY_NS, folder / "Ordner Quagga" / name
        frames = drive_frames(rig, FRAMES, seed=3, start_ns=start_ns, attacked={sensor: ATTACKED})
        write_mcap(path, rig, frames, vehicle=VEHICLE, place=place)
        recordings[sensor] = path
    assert run(["scan", *map(str, recordings.values()), "--store", store, "--jobs", "1"]) == 1
    return AttackedStore(recordings, folder / "audit")


def recorded_frames(path: Path) -> dict[int, Frame]:
    """The frames of a recording by their numbers."""
    with open_recording(path) as recording:
        known = survey(recording)
        stream = synchronise(recording, find_rigs(known)[0], known, colour=True)
        return {item.number: item for item in stream if isinstance(item, Frame)}

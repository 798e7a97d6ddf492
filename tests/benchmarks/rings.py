"""What a ring of cameras and a LiDAR find in time on rendered streets: clean frames that are raised, and walls.

    python -m tests.benchmarks.rings [--fleet nuscenes] [--scale 0.5] [--first 100] [--streets 9] [--walls 3] [--cost]

Each street is driven for ten frames by a vehicle of a published fleet, its cameras smaller by a scale, and scanned with
nothing learnt: printed are the frames that are raised and, behind the first, not audited, by camera. Then come streets
with a wall in eight of 14 frames before each camera in turn, 8 m away, or 4 m where the camera looks aside: the frames
that name S_0 by the rig of that camera and by others, and the incidents. With `--cost` only what measuring one street
takes in one read for all cameras, beside a read for each.
"""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.simulation.streets import STYLES
from auditor.model.arrays import Image, Points
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Rig
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import open_recording, search_rigs, survey
from auditor.recordings.synchronisation import streams
from tests.making.audits import ask
from tests.making.published_recordings import write_published
from tests.making.published_rigs import PUBLISHED_RIGS, PublishedRig
from tests.making.ring_drives import RingDrive, make_ring_drive

FRAMES, WALLED_FRAMES, ATTACKED = 10, 14, range(4, 12)
COST_FRAMES = 24
PAPER_RADIUS_SHARE = 280 / 1242
AHEAD_M, ASIDE_M = 8.0, 4.0
SIDEWAYS_DEG = 30.0
CAMERAS = """SELECT DISTINCT measurement_id, name FROM sensors
QUALIFY sensor = max(sensor) OVER (PARTITION BY measurement_id)"""

Clouds = Sequence[Mapping[str, Points]]


def seen(drive: RingDrive, frames: int) -> tuple[list[Mapping[str, Image]], list[Mapping[str, Points]]]:
    pictures = [{camera.name: drive.picture(n, camera) for camera in drive.rig.cameras} for n in range(frames)]
    return pictures, [{lidar.name: drive.points(n, lidar) for lidar in drive.rig.lidars} for n in range(frames)]


def scanned(
    folder: Path, rig: PublishedRig, pictures: Sequence[Mapping[str, Image]], clouds: Clouds
) -> tuple[list[dict[str, Any]], int]:
    """The verdicts of all frames, with the names of their cameras, and the number of incidents."""
    with TemporaryDirectory(dir=folder) as place:
        recording = write_published(Path(place) / "ring.mcap", rig, pictures, clouds)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            run(["scan", str(recording), "--store", f"{place}/audit"])
        store = Path(place) / "audit"
        names = {row["measurement_id"]: row["name"] for row in ask(store, CAMERAS)}
        rows = ask(store, "SELECT measurement_id, frame, kind, attacked FROM verdicts")
        return [{**row, "camera": names[row["measurement_id"]]} for row in rows], len(ask(store, "FROM incidents"))


def rigs_of(folder: Path, rig: PublishedRig, pictures: Sequence[Mapping[str, Image]], clouds: Clouds) -> list[Rig]:
    with TemporaryDirectory(dir=folder) as place:
        path = write_published(Path(place) / "ring.mcap", rig, pictures, clouds)
        with open_recording(path) as recording:
            found = search_rigs(survey(recording)).rigs
    return [one for one in found if one.by_time]


def clean(folder: Path, rig: PublishedRig, seed: int) -> Counter[str]:
    style = list(STYLES)[seed % len(STYLES)]
    rows, incidents = scanned(folder, rig, *seen(make_ring_drive(rig, seed, FRAMES, style=style), FRAMES))
    raised = Counter(row["camera"] for row in rows if row["kind"] not in ("clean", "not_auditable"))
    unseen = Counter(row["camera"] for row in rows if row["kind"] == "not_auditable" and row["frame"] > 0)
    print(f"{seed} {style}: raised {dict(raised)}, not audited {dict(unseen)}, {incidents} incidents", flush=True)
    return Counter(row["kind"] if row["frame"] else "first" for row in rows)


def told(what: str, camera: str, sensor: int, rows: Sequence[Mapping[str, Any]], incidents: int) -> None:
    """Print in how many attacked frames the rig of the camera names the attacked sensor, and those of others do."""
    named = Counter(row["camera"] for row in rows if row["attacked"] == [sensor] and row["frame"] in ATTACKED)
    print(
        f"{what} {camera}: named in {named.pop(camera, 0)} of {len(ATTACKED)}, by others {dict(named)}; "
        f"{incidents} incidents",
        flush=True,
    )


def walled(folder: Path, rig: PublishedRig, seed: int) -> None:
    pictures, clouds = seen(make_ring_drive(rig, seed, WALLED_FRAMES), WALLED_FRAMES)
    yaws = {camera.name: camera.yaw_deg for camera in rig.cameras}
    for lone in rigs_of(folder, rig, pictures, clouds):
        camera, lidar = lone.camera(1).name, lone.name(0)
        aside = abs(np.sin(np.radians(yaws[camera]))) > np.sin(np.radians(SIDEWAYS_DEG))
        wall = BogusWall(ASIDE_M if aside else AHEAD_M, 0.0, seed=seed)
        attacked = [
            {**cloud, lidar: wall.apply(PointCloud(n, cloud[lidar]), lone).xyz_m} if n in ATTACKED else cloud
            for n, cloud in enumerate(clouds)
        ]
        told(f"{seed}: wall {wall.range_m:g} m before", camera, 0, *scanned(folder, rig, pictures, attacked))


def lit(folder: Path, rig: PublishedRig, seed: int) -> None:
    """Streets with a facula of the paper's size on each camera in turn: frames that name it, and others."""
    pictures, clouds = seen(make_ring_drive(rig, seed, WALLED_FRAMES), WALLED_FRAMES)
    for camera in rig.cameras:
        width, height = camera.size_px
        draw = np.random.default_rng([seed, width, len(camera.name)]).uniform
        place = (draw(0.25, 0.75) * width, draw(0.25, 0.75) * height)
        light = Facula(255.0, PAPER_RADIUS_SHARE * width, *place)
        attacked = [
            {**one, camera.name: light.apply(CameraImage(1, n, one[camera.name])).pixels} if n in ATTACKED else one
            for n, one in enumerate(pictures)
        ]
        what = f"{seed}: facula at {place[0]:.0f}, {place[1]:.0f} on"
        told(what, camera.name, 1, *scanned(folder, rig, attacked, clouds))


def cost(folder: Path, rig: PublishedRig, seed: int) -> None:
    """The CPU time of measuring a drive in one read and in a read for each camera, in turn, and their ratio."""
    path = write_published(folder / "ring.mcap", rig, *seen(make_ring_drive(rig, seed, COST_FRAMES), COST_FRAMES))
    whole = streams.MOST_WAITING_BYTES
    spent: dict[str, list[float]] = {"warm": [], "one read": [], "a read each": []}
    for round_, how in enumerate(("warm", *("one read", "a read each") * 3)):
        streams.MOST_WAITING_BYTES = 0 if how == "a read each" else whole
        began = process_time()
        measure_recording(MeasureTask(path, folder / f"store {round_}"), lambda _, __: None)
        spent[how].append(process_time() - began)
    streams.FRAME_WINDOW = whole
    one, each = median(spent["one read"]), median(spent["a read each"])
    print(
        f"{len(rig.cameras)} cameras, {COST_FRAMES} frames: {one:.2f} and {each:.2f} CPU s, a ratio of {one / each:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--fleet", choices=PUBLISHED_RIGS, default="nuscenes")
    parser.add_argument("--scale", type=float, default=0.5)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--streets", type=int, default=9)
    parser.add_argument("--walls", type=int, nargs="*", default=[3], help="seeds of streets with walls")
    parser.add_argument("--lights", type=int, nargs="*", default=[3], help="seeds of streets with faculas")
    parser.add_argument("--cost", action="store_true")
    options = parser.parse_args()
    rig = PUBLISHED_RIGS[options.fleet].smaller(options.scale)
    with TemporaryDirectory() as place:
        if options.cost:
            cost(Path(place), rig, options.first)
            return
        total: Counter[str] = Counter()
        for seed in range(options.first, options.first + options.streets):
            total += clean(Path(place), rig, seed)
        print(dict(total))
        for seed in options.walls:
            walled(Path(place), rig, seed)
        for seed in options.lights:
            lit(Path(place), rig, seed)


if __name__ == "__main__":
    main()

"""Rigs of several LiDARs, from a recording to exit codes, queries and pages."""

import json
import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.attacks.spoofing import GhostCar
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Lidar, Rig
from auditor.recordings import located, open_recording, write_mcap
from tests.making.accessibility import complaints
from tests.making.audits import ask
from tests.making.removed_topics import without_sensors
from tests.making.restamped import Told, rewritten
from tests.making.several_lidars import BUMPER, REAR, ROOF, SCAN_NS, attacked, merged, rig_of, street

FRAMES = 6
GHOST = GhostCar(points=60, range_m=8.0, seed=1)
RIG = rig_of(ROOF, REAR)
SAID = "S_0 roof and S_1 rear: compared with each other's points where both look"
ALL_SEEN = ("--min-view", "0", "--min-coverage", "0.7")


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return list(street((ROOF, REAR), 46001, FRAMES))


def scanned(
    path: Path, rig: Rig, frames: Iterable[Frame], capfd: pytest.CaptureFixture[str], *options: str
) -> tuple[int, str]:
    write_mcap(path, rig, frames)
    store = path.with_suffix(".audit")
    code = run(["scan", str(path), "--store", str(store), "--pictures", "none", *options])
    return code, capfd.readouterr().err


def at(frame: Frame, stamp_ns: int) -> Frame:
    """The frame at another time."""
    clouds = {sensor: replace(cloud, stamp_ns=stamp_ns) for sensor, cloud in frame.clouds.items()}
    return replace(frame, stamp_ns=stamp_ns, cloud=clouds.pop(0), others=clouds)


def found(path: Path) -> list[tuple[str, tuple[int, ...]]]:
    """The kind and the attacked sensors of each incident."""
    rows = ask(path.with_suffix(".audit"), "SELECT kind, attacked FROM incidents WHERE grade = 'incident'")
    return [(row["kind"], tuple(row["attacked"])) for row in rows]


def test_two_lidars_that_agree_are_clean_and_the_share_that_was_compared_is_told(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "clean.mcap"
    code, remarks = scanned(path, RIG, frames, capfd)
    assert (code, SAID in remarks) == (3, True)
    assert scanned(path, RIG, frames, capfd, *ALL_SEEN)[0] == 0
    looked = ask(path.with_suffix(".audit"), "SELECT name, one_share, two_share FROM looked ORDER BY sensor")
    assert [row["name"] for row in looked] == ["roof", "rear"]
    assert all(0.2 < row["one_share"] < 0.6 and row["two_share"] == 0 for row in looked)
    assert found(path) == []


@pytest.mark.parametrize("sensor", [0, 1])
def test_a_ghost_that_stands_from_the_first_frame_on_is_an_incident_of_one_of_the_two(
    frames: list[Frame], sensor: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "ghost.mcap"
    code, _ = scanned(path, RIG, [attacked(one, RIG, sensor, GHOST) for one in frames], capfd, *ALL_SEEN)
    assert code == 1
    assert found(path) == [("unidentified", ())]
    first, *reasons = ask(path.with_suffix(".audit"), "SELECT kind, reason FROM verdicts ORDER BY frame")
    assert first["kind"] == "not_auditable"
    assert all(f"S_{sensor} (50 %) or S_{1 - sensor} (50 %)" in row["reason"] for row in reasons)
    page = incident_page(path)
    assert complaints(page) == []
    assert "one of the two has points where the other&#39;s beams passed" in page
    assert "contradict each other: an attack on one of them was detected" in page
    place = re.search(r"In \d+\sframes? LiDAR .*\((\w+)\) has points (\d+\.\d) m ahead of it, ", page)
    assert place
    assert (place[1], float(place[2])) == (RIG.name(sensor), pytest.approx(8.0, abs=0.2))
    assert re.search(r"within 0\.\d m of one place beside the vehicle", page)
    assert run(["verify", "--store", str(path.with_suffix(".audit"))]) == 0


def marked_points(ply: Path) -> int:
    _, body = ply.read_bytes().split(b"end_header\n")
    return int(np.frombuffer(body, np.dtype("3f4, 3u1, u1"))["f2"].sum())


def incident_page(path: Path, incident: str = "") -> str:
    """The page of the one incident, or of that whose id is given, without the marks around names."""
    store = path.with_suffix(".audit")
    assert run(["report", "--store", str(store)]) == 0
    [page] = (store / "reports" / "incidents").glob(f"{incident}*.html")
    return re.sub(r"</?bdi[^>]*>", "", page.read_text())


def test_the_case_of_two_lidars_has_the_clouds_the_pictures_and_the_boxes_of_both(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, case = tmp_path / "ghost.mcap", tmp_path / "case"
    scanned(path, RIG, [attacked(one, RIG, 1, GHOST) for one in frames], capfd, *ALL_SEEN)
    [row] = ask(path.with_suffix(".audit"), "SELECT incident_id, strongest_frame FROM incidents")
    assert run(["case", row["incident_id"], "--store", str(path.with_suffix(".audit")), "--into", str(case)]) == 0
    frame = row["strongest_frame"]
    pictures = {one.name for one in (case / "pictures").glob(f"{frame}_*")}
    assert pictures == {f"{frame}_S0.above.png", f"{frame}_S0.range.png", f"{frame}_S1.range.png"}
    assert [marked_points(case / "clouds" / name) > 0 for name in (f"{frame}.ply", f"{frame}_S1.ply")] == [False, True]
    with open_recording(located(case / "findings.mcap")) as findings:
        topics = {topic.name for topic in findings.topics()}
    assert {"/auditor/S_1/box", "/auditor/S_1/damaged"} <= topics
    assert not {"/auditor/S_0/annotations", "/auditor/S_0/box"} & topics


def test_a_ghost_that_appears_names_the_lidar_whose_own_past_contradicts_it(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "ghost.mcap"
    late = [attacked(one, RIG, 1, GHOST) if one.number > 2 else one for one in frames]
    assert scanned(path, RIG, late, capfd, *ALL_SEEN)[0] == 1
    assert found(path) == [("attacked", (1,))]


def test_two_lidars_that_agree_name_a_third_one(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    left, right = (replace(ROOF, name=name, at_m=(0.6, y, 1.9)) for name, y in (("left", 0.5), ("right", -0.5)))
    three = (left, right, REAR)
    rig, path = rig_of(*three), tmp_path / "ghost.mcap"
    frames = [attacked(one, rig, 1, GHOST) for one in street(three, 46001, FRAMES - 1)]
    assert scanned(path, rig, frames, capfd, *ALL_SEEN)[0] == 1
    assert found(path) == [("attacked", (1,))]


@pytest.fixture(scope="module")
def beside_cameras() -> tuple[SyntheticDrive, list[Frame]]:
    """A drive with cameras and a LiDAR, to which a second one is added at the same place."""
    drive = make_drive(2, FRAMES, n_cameras=2, width_px=310, height_px=94)
    return drive, list(drive.frames())


@pytest.mark.parametrize("on", ["", "side", "top"])
def test_a_lidar_beside_that_of_cameras_is_compared_with_it(
    beside_cameras: tuple[SyntheticDrive, list[Frame]], on: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    drive, whole = beside_cameras
    assert drive.rig.lidar
    side = Rig(replace(drive.rig.lidar, name="side", topic="/side/points"), ())
    wall = BogusWall(8.0, 0.0)
    clouds = [one.cloud and (wall.apply(one.cloud, drive.rig) if on == "side" else one.cloud) for one in whole]
    cars = [replace(one, cloud=one.cloud and wall.apply(one.cloud, drive.rig)) if on == "top" else one for one in whole]
    write_mcap(tmp_path / "cars.mcap", drive.rig, cars)
    presence = [{LIDAR: one.presence[LIDAR]} for one in whole]
    beside = [
        replace(one, cloud=cloud, images={}, presence=there)
        for one, cloud, there in zip(whole, clouds, presence, strict=True)
    ]
    write_mcap(tmp_path / "beside.mcap", side, beside)
    path = merged(tmp_path / "drive.mcap", tmp_path / "cars.mcap", tmp_path / "beside.mcap")
    code = run(["scan", str(path), "--store", str(path.with_suffix(".audit")), "--pictures", "none", *ALL_SEEN])
    capfd.readouterr()
    if not on:
        said = "S_0 side: compared with another LiDAR's points where both look"
        assert run(["inspect", str(path)]) == 3
        assert said in capfd.readouterr().out, "that of the cameras is looked at by these"
        assert run(["judge", "--store", str(path.with_suffix(".audit")), "--min-view", "0.5"]) == 3
        assert said in capfd.readouterr().err
    rigs = ask(path.with_suffix(".audit"), "SELECT kind, n FROM rigs ORDER BY n")
    assert [(row["kind"][:9], row["n"]) for row in rigs] == [
        ("2 LiDARs ", 0),
        *[("LiDAR + 1", 1)] * 2,
        ("LiDAR + 2", 2),
    ]
    assert code == (1 if on else 0)
    named = [one for one in found(path) if one[1]]
    unnamed = [one for one in found(path) if not one[1]]
    assert unnamed == [("unidentified", ())] * {"": 0, "side": 1, "top": 2}[on]
    assert {*named} <= {("attacked", (0,))} if on == "top" else not named, "by the past of the cameras"
    if on:
        of_lidars = "SELECT incident_id FROM incidents JOIN rigs USING (rig_id) WHERE n = 0"
        page = incident_page(path, ask(path.with_suffix(".audit"), of_lidars)[0]["incident_id"])
        assert "is compared with cameras, too" in page
        assert "By their verdicts it was attacked in none of" in page
        assert "show the place. That is a hint at" in page


def test_a_lidar_that_is_missing_for_some_frames_leaves_the_other_to_its_own_past(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "missing.mcap"
    some = [replace(one, others={}) if one.number in (2, 3) else one for one in frames]
    assert scanned(path, RIG, some, capfd, *ALL_SEEN)[0] == 0
    rows = ask(path.with_suffix(".audit"), "SELECT frame, kind, reason FROM verdicts ORDER BY frame")
    assert {row["kind"] for row in rows[1:]} == {"clean"}
    assert [row["frame"] for row in rows if "judged without S_1" in (row["reason"] or "")] == [2, 3]


def test_lidars_without_places_in_tf_are_rigs_of_their_own(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    whole, path = tmp_path / "whole.mcap", tmp_path / "unplaced.mcap"
    write_mcap(whole, RIG, frames)
    without_sensors(whole, path, Rig(Lidar("tf", "/tf_static", np.eye(4)), ()), [LIDAR])
    assert run(["scan", str(path), "--store", str(tmp_path / "audit"), "--pictures", "none"]) == 3
    assert capfd.readouterr().err.count("is looked at for what appears, by its own past alone") == 2
    assert run(["inspect", str(path)]) == 3
    said = capfd.readouterr().out
    for name in ("roof", "rear"):
        assert f"no tf joins the frame '{name}' of /{name}/points to that of another LiDAR" in said
    rigs = ask(tmp_path / "audit", "SELECT kind FROM rigs")
    assert [row["kind"] for row in rigs] == ["LiDAR alone", "LiDAR alone"]


def test_a_lidar_of_half_the_rate_is_compared_in_each_of_its_scans(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    standing = list(street((ROOF, BUMPER), 46009, 8, standing=True))
    odd = [one if one.number % 2 else replace(one, others={}) for one in standing]
    shifted = [at(one, one.stamp_ns // 2) for one in odd]
    path = tmp_path / "odd.mcap"
    assert scanned(path, rig_of(ROOF, BUMPER), shifted, capfd, *ALL_SEEN)[0] == 0
    [row] = ask(path.with_suffix(".audit"), "SELECT count(*) AS n FROM verdicts WHERE kind = 'clean'")
    assert row["n"] == 3
    assert all(row["one_share"] > 0.02 for row in ask(path.with_suffix(".audit"), "SELECT one_share FROM looked"))


@pytest.mark.parametrize("late_ns", [SCAN_NS // 2, 3600 * 10**9])
def test_lidars_of_other_clocks_are_compared_all_the_same(
    frames: list[Frame], late_ns: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The stamps of the second LiDAR are half a scan, or an hour, behind the times of recording."""
    whole, path = tmp_path / "whole.mcap", tmp_path / "clocks.mcap"
    write_mcap(whole, RIG, [attacked(one, RIG, 1, GHOST) for one in frames])

    def late(one: Told) -> list[Told]:
        return [one._replace(stamp_ns=one.stamp_ns + late_ns) if one.topic == RIG.topic(1) else one]

    rewritten(whole, path, late)
    code = run(["scan", str(path), "--store", str(path.with_suffix(".audit")), "--pictures", "none", *ALL_SEEN])
    capfd.readouterr()
    assert (code, found(path)) == (1, [("unidentified", ())])


def test_inspect_says_what_two_lidars_can_tell_and_writes_a_rig_file_that_a_scan_takes(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, file, picture = (tmp_path / name for name in ("clean.mcap", "rig.toml", "rig.svg"))
    write_mcap(path, RIG, frames)
    words = ["--write-rig", str(file), "--picture", str(picture), "--format", "json"]
    assert run(["inspect", str(path), *words]) == 3
    [rig] = json.loads(capfd.readouterr().out)[0]["rigs"]
    assert (rig["kind"], [one["name"] for one in rig["sensors"]]) == ("2 LiDARs 1.60 m apart", ["roof", "rear"])
    assert "do not say which is attacked" in rig["capabilities"][1]
    assert SAID in " ".join(rig["reading"])
    assert run(["inspect", str(path)]) == 3
    assert "Messages, presence, and offset to the LiDAR S_1" in capfd.readouterr().out
    assert "compared with each other: S_0 roof, S_1 rear" in picture.read_text()
    assert scanned(path, RIG, frames, capfd, "--rig", str(file), *ALL_SEEN)[0] == 0
    assert (
        ask(path.with_suffix(".audit"), "SELECT count(*) AS n FROM verdicts WHERE kind = 'clean'")[0]["n"] == FRAMES - 1
    )


def test_one_of_two_lidars_can_be_attacked_by_the_command_line(
    frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, copy = tmp_path / "clean.mcap", tmp_path / "attacked.mcap"
    write_mcap(path, RIG, frames)
    assert run(["attack", str(path), str(copy), "--on", "S_1", "--kind", "far-wall", "--size", "10"]) == 0
    assert run(["scan", str(copy), "--store", str(tmp_path / "audit"), "--pictures", "none"]) == 4
    truth = ask(tmp_path / "audit", "SELECT DISTINCT truth FROM truth")
    assert [row["truth"] for row in truth] == [[1]]
    capfd.readouterr()

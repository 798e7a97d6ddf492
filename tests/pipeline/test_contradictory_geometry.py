"""Geometry and clocks that contradict themselves are put right by the images and points, or no verdict is given."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.cli import run
from auditor.errors import RigError, ThresholdsError
from auditor.lab.simulation.drives import make_drive
from auditor.model.frames import Frame
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Camera, Rig
from auditor.model.verdict import VerdictKind
from auditor.pipeline.geometry import rigs_through
from auditor.recordings import RigsInForce, open_recording, survey, write_mcap
from auditor.recordings.writers import frames as writer
from auditor.recordings.writers.messages import MessageMaker
from auditor.store.store import Store
from tests.making.calibrations import calibrate
from tests.making.split_drives import CALIBRATION, messages_of, write_messages


@dataclass(frozen=True, eq=False)
class RenderedDrive:
    """The rig and frames of a drive; nobody writes into their images."""

    rig: Rig
    kept: tuple[Frame, ...]

    def frames(self) -> Iterator[Frame]:
        """All frames, in order."""
        return iter(self.kept)


def rendered_drive(seed: int, frames: int, *, width_px: int, height_px: int) -> RenderedDrive:
    """A street of images of this size: to render four frames of 621 x 188 px takes a second."""
    drive = make_drive(seed, frames, width_px=width_px, height_px=height_px)
    kept = tuple(drive.frames())
    for frame in kept:
        for image in frame.images.values():
            image.pixels.setflags(write=False)
    return RenderedDrive(drive.rig, kept)


Points = Callable[[Matrix], Matrix]


@pytest.fixture(scope="module")
def drive() -> RenderedDrive:
    return rendered_drive(2, 4, width_px=414, height_px=125)


def negated(camera: Camera) -> Matrix:
    return camera.projection * np.array([1, 1, 1, -1])


def doubled(camera: Camera) -> Matrix:
    return camera.projection * np.array([1, 1, 1, 2])


def scaled(rig: Rig, by: float) -> Rig:
    """The same cameras with `by` times the pixels."""
    cameras = (
        replace(
            camera,
            width_px=round(by * camera.width_px),
            height_px=round(by * camera.height_px),
            projection=np.diag([by, by, 1.0]) @ camera.projection,
        )
        for camera in rig.cameras
    )
    return Rig(rig.lidar, tuple(cameras))


def with_points(drive: RenderedDrive, change: Points) -> Iterator[Frame]:
    for frame in drive.frames():
        assert frame.cloud is not None
        yield replace(frame, cloud=replace(frame.cloud, xyz_m=change(frame.cloud.xyz_m).astype(np.float32)))


def found_in(path: Path) -> RigsInForce:
    with open_recording(path) as recording:
        return rigs_through(recording, survey(recording))


def scan(path: Path, folder: Path) -> tuple[int, Store, str]:
    """The exit code, the store and why verdicts are withheld."""
    code = run(["scan", str(path), "--store", str(folder / "audit"), "--jobs", "1"])
    store = Store.open(folder / "audit")
    [measurement] = store.measurements()
    return code, store, measurement.withheld or ""


def kinds(store: Store) -> dict[VerdictKind, int]:
    [judgement] = store.current_judgements().values()
    return {kind: count for kind, count in judgement.counts.items() if count}


@pytest.mark.parametrize("wrong", [negated, doubled])
def test_positions_of_p_that_tf_contradicts_are_those_that_fit(
    drive: RenderedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: Callable[[Camera], Matrix]
) -> None:
    monkeypatch.setattr(writer, "_projection", wrong)
    write_mcap(tmp_path / "wrong.mcap", drive.rig, drive.frames())
    found = found_in(tmp_path / "wrong.mcap")
    assert not found.withheld
    assert "and tf" in found.remarks[0]
    assert "the camera positions of tf were taken" in found.remarks[0]
    [one] = found.rigs
    assert [camera.topic for camera in one.rig.cameras] == [camera.topic for camera in drive.rig.cameras]
    assert one.rig.baseline_m(1, one.rig.n) == pytest.approx(drive.rig.baseline_m(1, drive.rig.n), abs=1e-6)


def test_frames_of_bodies_are_taken_for_what_they_are(
    drive: RenderedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """tf has x ahead and z up in the frames of the cameras."""
    optical_SE3_body = motion(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))
    transforms = MessageMaker.transforms

    def of_bodies(maker: MessageMaker, parent: str, children: Mapping[str, Matrix], stamp_ns: int) -> bytes:
        lidar = drive.rig.lidar.name if drive.rig.lidar else ""
        turned = {n: place if lidar in n else place @ optical_SE3_body for n, place in children.items()}
        return transforms(maker, parent, turned, stamp_ns)

    monkeypatch.setattr(MessageMaker, "transforms", of_bodies)
    write_mcap(tmp_path / "bodies.mcap", drive.rig, drive.frames())
    found = found_in(tmp_path / "bodies.mcap")
    assert not found.withheld
    assert "x of their frames was taken to look ahead" in found.remarks[0]
    assert found.rigs[0].rig.lidar is not None
    assert drive.rig.lidar is not None
    true, read = drive.rig.lidar.rig_SE3_lidar, found.rigs[0].rig.lidar.rig_SE3_lidar
    np.testing.assert_allclose(read, true, atol=1e-9)


def test_k_and_p_of_a_larger_picture_are_scaled_and_that_is_said(drive: RenderedDrive, tmp_path: Path) -> None:
    write_mcap(tmp_path / "larger.mcap", scaled(drive.rig, 2.0), drive.frames())
    found = found_in(tmp_path / "larger.mcap")
    assert not found.withheld
    assert "its K and P were scaled by 0.5" in found.remarks[0]
    assert found.rigs[0].rig.camera(1).focal_px == pytest.approx(drive.rig.camera(1).focal_px)


def test_k_and_p_that_are_of_the_pictures_already_stay_as_they_are(
    drive: RenderedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "_projection", lambda camera: np.diag([0.5, 0.5, 1.0]) @ camera.projection)
    write_mcap(tmp_path / "declared.mcap", scaled(drive.rig, 2.0), drive.frames())
    found = found_in(tmp_path / "declared.mcap")
    assert not found.withheld
    assert "K and P were taken as those of the recorded pictures" in found.remarks[0]
    assert found.rigs[0].rig.camera(1).focal_px == pytest.approx(drive.rig.camera(1).focal_px)


def test_a_size_that_no_ratio_explains_and_that_does_not_fit_is_withheld(drive: RenderedDrive, tmp_path: Path) -> None:
    wide = replace(drive.rig.camera(1), width_px=1000)
    cameras = tuple(replace(camera, width_px=wide.width_px) for camera in scaled(drive.rig, 1.7).cameras)
    write_mcap(tmp_path / "odd.mcap", Rig(drive.rig.lidar, cameras), drive.frames())
    found = found_in(tmp_path / "odd.mcap")
    assert "declares 1000 x 212 px, and the pictures have 414 x 125 px" in found.withheld
    assert "--rig" in found.withheld


def with_zero_lens(rig: Rig, *, lidar: bool = True) -> Rig:
    """The rig of the same cameras, as a driver describes them that calls any lens `equidistant`."""
    cameras = (
        replace(camera, topic=f"/{camera.name}/image_raw", rectified=False, lens=Lens("equidistant", (0.0,) * 4))
        for camera in rig.cameras
    )
    return Rig(rig.lidar if lidar else None, tuple(cameras))


def bent(frame: Frame, rig: Rig) -> Frame:
    """The frame as cameras see it whose lens maps equal angles to equal distances."""
    images = {}
    for number, image in frame.images.items():
        K, (height, width) = rig.camera(number).projection[:, :3], image.pixels.shape[:2]
        v, u = np.mgrid[:height, :width]
        x, y = (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]
        angle = np.maximum(np.hypot(x, y), 1e-9)
        ratio = np.tan(angle) / angle
        at = (np.float32(K[0, 0] * x * ratio + K[0, 2]), np.float32(K[1, 1] * y * ratio + K[1, 2]))
        images[number] = replace(image, pixels=cv2.remap(image.pixels, *at, cv2.INTER_LINEAR))
    return replace(frame, images=images)


def test_a_lens_named_without_coefficients_is_none_where_the_sides_fit_so(drive: RenderedDrive, tmp_path: Path) -> None:
    write_mcap(tmp_path / "named.mcap", with_zero_lens(drive.rig), drive.frames())
    found = found_in(tmp_path / "named.mcap")
    assert not found.withheld
    assert "is called 'equidistant' with coefficients of 0: none was taken" in found.remarks[0]
    assert {camera.lens for camera in found.rigs[0].rig.cameras} == {NO_LENS}


def test_a_lens_of_zeros_is_as_named_where_the_sides_fit_so(drive: RenderedDrive, tmp_path: Path) -> None:
    frames = (bent(frame, drive.rig) for frame in drive.frames())
    write_mcap(tmp_path / "bent.mcap", with_zero_lens(drive.rig), frames)
    found = found_in(tmp_path / "bent.mcap")
    assert not found.remarks
    assert {camera.lens.model for camera in found.rigs[0].rig.cameras} == {"equidistant"}


def test_cameras_are_left_out_where_nothing_tells_which_lens_they_have(drive: RenderedDrive, tmp_path: Path) -> None:
    frames = (replace(frame, cloud=None) for frame in drive.frames())
    write_mcap(tmp_path / "unsaid.mcap", with_zero_lens(drive.rig, lidar=False), frames)
    with pytest.raises(RigError, match="do not tell whether it has one: give a rig file"):
        found_in(tmp_path / "unsaid.mcap")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda xyz: xyz * np.array([1, -1, 1]), "with y negated, and not as they are"),
        (lambda xyz: xyz * np.array([-1, -1, 1]), "no camera sees points"),
    ],
    ids=["left-handed", "turned"],
)
def test_points_that_fit_no_image_withhold_verdicts(
    drive: RenderedDrive, tmp_path: Path, change: Points, why: str
) -> None:
    write_mcap(tmp_path / "points.mcap", drive.rig, with_points(drive, change))
    code, _, withheld = scan(tmp_path / "points.mcap", tmp_path)
    assert code == 3
    assert why in withheld


def test_points_that_fit_no_image_are_no_attack(drive: RenderedDrive, tmp_path: Path) -> None:
    write_mcap(tmp_path / "feet.mcap", drive.rig, with_points(drive, lambda xyz: xyz * 3.28))
    code, store, withheld = scan(tmp_path / "feet.mcap", tmp_path)
    assert code == 3
    assert "fit the images nowhere" in withheld
    assert kinds(store) == {VerdictKind.NOT_AUDITABLE: 4}
    [measurement] = store.ids("measurements")
    with pytest.raises(ThresholdsError, match="verdicts are withheld"):
        calibrate([(store, measurement)])
    assert run(["judge", str(tmp_path / "audit"), "--method", "paper"]) == 3
    assert kinds(store) == {VerdictKind.NOT_AUDITABLE: 4}
    assert run(["inspect", str(tmp_path / "feet.mcap")]) == 3


def test_a_change_of_the_calibration_is_named_where_nothing_fits_after_it(drive: RenderedDrive, tmp_path: Path) -> None:
    feet = messages_of(".mcap", drive.rig, with_points(drive, lambda xyz: xyz * 3.28))
    wider = (replace(camera, projection=np.diag([0.9, 0.9, 1.0]) @ camera.projection) for camera in drive.rig.cameras)
    other = messages_of(".mcap", replace(drive.rig, cameras=tuple(wider)), drive.frames())
    begin_ns = min(message.log_time_ns for message in feet)
    before = [replace(one, log_time_ns=begin_ns - 10**9) for one in other if one.schema in CALIBRATION]
    path = write_messages(tmp_path / "changed.mcap", [*before, *feet])
    code, _, withheld = scan(path, tmp_path)
    assert code == 3
    assert withheld.startswith("the calibration changes at ")
    assert "fit the images nowhere" in withheld


def test_a_lidar_that_is_stamped_a_period_early_is_no_attack(tmp_path: Path) -> None:
    drive = replace(make_drive(2, 6, width_px=414, height_px=125), speed_m_s=18.0)
    frames = list(drive.frames())
    early = [
        replace(frame, cloud=replace(behind.cloud, stamp_ns=frame.stamp_ns)) if behind.cloud else frame
        for frame, behind in pairwise(frames)
    ]
    write_mcap(tmp_path / "early.mcap", drive.rig, early)
    code, store, withheld = scan(tmp_path / "early.mcap", tmp_path)
    assert code == 3
    assert "its stamps are a period early" in withheld
    assert set(kinds(store)) == {VerdictKind.NOT_AUDITABLE}


def test_what_withholds_verdicts_of_two_cameras_does_so_of_each_alone(
    drive: RenderedDrive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    two = replace(drive.rig, cameras=(replace(drive.rig.camera(1), number=1), replace(drive.rig.camera(3), number=2)))
    frames = [
        replace(frame, images={1: frame.images[1], 2: replace(frame.images[3], sensor=2)}, presence={})
        for frame in with_points(drive, lambda xyz: xyz * 3.28)
    ]
    write_mcap(tmp_path / "feet.mcap", two, frames)
    assert run(["scan", str(tmp_path / "feet.mcap"), "--store", str(tmp_path / "audit"), "--jobs", "1"]) == 3
    whys = {one.withheld for one in Store.open(tmp_path / "audit").measurements()}
    assert len(list(Store.open(tmp_path / "audit").measurements())) == 3
    assert len(whys) == 1
    assert "fit the images nowhere" in (whys.pop() or "")
    capsys.readouterr()
    assert run(["inspect", str(tmp_path / "feet.mcap")]) == 3
    assert capsys.readouterr().out.count("verdicts are withheld") == 3


def test_points_without_the_ground_withhold_verdicts(drive: RenderedDrive, tmp_path: Path) -> None:
    write_mcap(tmp_path / "obstacles.mcap", drive.rig, with_points(drive, lambda xyz: xyz[xyz[:, 2] > -1.4]))
    code, store, withheld = scan(tmp_path / "obstacles.mcap", tmp_path)
    assert code == 3
    assert "hold no ground" in withheld
    assert kinds(store) == {VerdictKind.NOT_AUDITABLE: 4}


def test_a_sector_without_points_does_not_withhold_verdicts(drive: RenderedDrive, tmp_path: Path) -> None:
    write_mcap(tmp_path / "sector.mcap", drive.rig, with_points(drive, lambda xyz: xyz[xyz[:, 1] > 0.1 * xyz[:, 0]]))
    _, store, withheld = scan(tmp_path / "sector.mcap", tmp_path)
    assert not withheld
    assert VerdictKind.ATTACKED in kinds(store)


def test_points_in_millimetres_are_not_read(
    drive: RenderedDrive, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_mcap(tmp_path / "mm.mcap", drive.rig, with_points(drive, lambda xyz: xyz * 1000))
    assert run(["scan", str(tmp_path / "mm.mcap"), "--store", str(tmp_path / "audit")]) == 3
    assert "not metres" in " ".join(capfd.readouterr().err.split())


def test_a_sign_that_nothing_contradicts_is_told_by_the_images(
    drive: RenderedDrive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_one_frame = dict.fromkeys(range(1, drive.rig.n + 1), "camera") | {0: "lidar"}
    monkeypatch.setattr(writer, "_projection", negated)
    monkeypatch.setattr(writer, "_frame_ids", lambda rig: in_one_frame)
    write_mcap(tmp_path / "sign.mcap", drive.rig, drive.frames())
    code, _, withheld = scan(tmp_path / "sign.mcap", tmp_path)
    assert code == 3
    assert "reverse order" in withheld


@pytest.mark.parametrize(
    ("way", "rows", "columns"), [("turned by half", -1, -1), ("mirrored", 1, -1), ("last row to the first", -1, 1)]
)
def test_a_camera_whose_pictures_are_another_way_up_is_no_attack(
    drive: RenderedDrive, tmp_path: Path, way: str, rows: int, columns: int
) -> None:
    def turned(frame: Frame) -> Frame:
        image = frame.images[2]
        pixels = np.ascontiguousarray(image.pixels[::rows, ::columns])
        return replace(frame, images={**frame.images, 2: replace(image, pixels=pixels)})

    write_mcap(tmp_path / "turned.mcap", drive.rig, map(turned, drive.frames()))
    code, store, withheld = scan(tmp_path / "turned.mcap", tmp_path)
    assert code == 3
    assert f"{drive.rig.camera(2).topic} fit the others'" in withheld
    assert way in withheld
    assert kinds(store) == {VerdictKind.NOT_AUDITABLE: 4}


def test_cameras_out_of_phase_are_not_compared(drive: RenderedDrive, tmp_path: Path) -> None:
    def late(frame: Frame) -> Frame:
        image = frame.images[1]
        return replace(frame, images={**frame.images, 1: replace(image, stamp_ns=image.stamp_ns + 90_000_000)})

    slow = [_at(late(frame), number * 200_000_000) for number, frame in enumerate(drive.frames())]
    write_mcap(tmp_path / "phase.mcap", drive.rig, slow)
    code, store, withheld = scan(tmp_path / "phase.mcap", tmp_path)
    assert code == 3
    assert withheld.startswith("exposures 90 ms apart: ")
    assert set(kinds(store)) == {VerdictKind.NOT_AUDITABLE}


def _at(frame: Frame, later_ns: int) -> Frame:
    """The frame at another pace: 200 ms from one to the next."""
    start = 1_700_000_000 * 10**9
    moved = start + later_ns - frame.stamp_ns
    images = {number: replace(one, stamp_ns=one.stamp_ns + moved) for number, one in frame.images.items()}
    cloud = replace(frame.cloud, stamp_ns=frame.cloud.stamp_ns + moved) if frame.cloud else None
    return replace(frame, stamp_ns=frame.stamp_ns + moved, images=images, cloud=cloud)

"""A place in tf that is said again later, otherwise, is taken where images and points fit it; what moved has moved."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.lab.simulation.drives import make_drive
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.pipeline.geometry import in_force, rigs_through
from auditor.recordings import RigsInForce, open_recording, survey
from auditor.recordings.rigs.changes import WHOLE
from tests.making.split_drives import messages_of, write_messages

TURNED = np.array([[1, 0, 0, 0], [0, 0.995, -0.1, 0], [0, 0.1, 0.995, 0], [0, 0, 0, 1]])
"""Downwards by 6 degrees."""


@pytest.fixture(scope="module")
def drive() -> tuple[Rig, list[Frame]]:
    made = make_drive(2, 4, width_px=414, height_px=125)
    return made.rig, list(made.frames())


def turned(rig: Rig) -> Rig:
    assert rig.lidar
    return replace(rig, lidar=replace(rig.lidar, rig_SE3_lidar=TURNED @ rig.lidar.rig_SE3_lidar))


def seen_turned(frame: Frame, rig: Rig) -> Frame:
    """The frame with the points of a LiDAR that was turned."""
    assert rig.lidar
    assert frame.cloud
    there = np.linalg.inv(TURNED @ rig.lidar.rig_SE3_lidar) @ rig.lidar.rig_SE3_lidar
    points = frame.cloud.xyz_m @ there[:3, :3].T + there[:3, 3]
    return replace(frame, cloud=replace(frame.cloud, xyz_m=points.astype(np.float32)))


def found_in(path: Path, *parts: tuple[Rig, Sequence[Frame]]) -> RigsInForce:
    """What is in force in a recording of frames with the calibration of a rig, then of another one."""
    write_messages(path, [message for rig, frames in parts for message in messages_of(".mcap", rig, frames)])
    with open_recording(path) as recording:
        known = survey(recording)
        found = rigs_through(recording, known)
        for one in found.rigs:
            assert in_force(recording, known, one.rig).stretches == one.stretches
    return found


@pytest.mark.parametrize("first", [True, False])
def test_of_two_places_that_are_said_in_turn_the_one_that_fits_is_in_force_throughout(
    drive: tuple[Rig, list[Frame]], tmp_path: Path, first: bool
) -> None:
    rig, frames = drive
    rigs = (rig, turned(rig)) if first else (turned(rig), rig)
    found = found_in(tmp_path / "a.mcap", (rigs[0], frames[:2]), (rigs[1], frames[2:]))
    [one] = found.rigs
    assert one.stretches == WHOLE
    assert one.rig.lidar
    np.testing.assert_allclose(one.rig.lidar.rig_SE3_lidar, rig.lidar and rig.lidar.rig_SE3_lidar, atol=1e-9)
    [told] = found.changes
    assert told.what.startswith("the calibration changes at 0.2 s (tf from ")
    before = "the one before it stays in force" if first else "it was taken from the beginning"
    assert told.then == f"{before}, for so the images and points fit"
    assert found.remarks == (f"{told.what}: {told.then}",)


def test_a_lidar_that_was_turned_has_a_rig_of_its_own(drive: tuple[Rig, list[Frame]], tmp_path: Path) -> None:
    rig, frames = drive
    later = [seen_turned(frame, rig) for frame in frames[2:]]
    found = found_in(tmp_path / "a.mcap", (rig, frames[:2]), (turned(rig), later))
    assert len(found.rigs) == 2
    assert "have a rig of their own" in found.remarks[0]


def test_a_place_that_is_put_right_again_leaves_one_rig(drive: tuple[Rig, list[Frame]], tmp_path: Path) -> None:
    rig, frames = drive
    apart = [later_by(frame, 15 * number) for number, frame in enumerate(frames)]
    found = found_in(tmp_path / "a.mcap", (rig, apart[:1]), (turned(rig), apart[1:3]), (rig, apart[3:]))
    [one] = found.rigs
    assert one.stretches == WHOLE


def later_by(frame: Frame, periods: int) -> Frame:
    """The frame so many tenths of a second later."""
    by_ns = periods * 10**8
    assert frame.cloud
    return replace(
        frame,
        stamp_ns=frame.stamp_ns + by_ns,
        cloud=replace(frame.cloud, stamp_ns=frame.cloud.stamp_ns + by_ns),
        images={n: replace(image, stamp_ns=image.stamp_ns + by_ns) for n, image in frame.images.items()},
    )

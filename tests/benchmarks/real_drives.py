"""The real drives as benchmarks and tests use them: LiDAR, cam1, cam3 and the reference camera cam2."""

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, survey, synchronise

LEFT_OUT = "camera_gray_left"


def drive(number: str) -> Path:
    """The folder of one drive, 04 of KITTI's odometry; AUDITOR_TEST_DATA names where they lie."""
    name = "kitti_odometry_04" if number == "04" else f"kitti_raw_2011_09_26_drive_{number}"
    return Path(os.environ["AUDITOR_TEST_DATA"]) / name


def without(rig: Rig, name: str) -> Rig:
    """A rig without one of its cameras, renumbered from right to left."""
    kept = [camera for camera in rig.cameras if camera.name != name]
    return Rig(rig.lidar, tuple(replace(camera, number=number) for number, camera in enumerate(kept, start=1)))


def frames(number: str, *, all_cameras: bool = False, colour: bool = False) -> tuple[Rig, Iterator[Frame]]:
    """The rig (S_1 = cam1, S_2 = cam3, S_3 = cam2; or all four cameras) and the frames of a drive.

    With `colour` as a scan sees them: cam2 and cam3 have colours.
    """
    recording = open_recording(drive(number))
    surveyed = survey(recording)
    rig = find_rigs(surveyed)[0]
    if not all_cameras:
        rig = without(rig, LEFT_OUT)
    stream = synchronise(recording, rig, surveyed, colour=colour)
    return rig, (frame for frame in stream if isinstance(frame, Frame))

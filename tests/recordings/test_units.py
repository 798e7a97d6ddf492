"""Points in another unit than metres: said, and read where the rig file says the unit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from auditor.errors import RigError
from auditor.model.frames import Frame
from auditor.pipeline.geometry import rigs_through
from auditor.recordings import open_recording, schemas, survey, synchronise, write_rig
from auditor.recordings.writers.messages import MessageMaker
from tests.making.message_forms import drive, ros
from tests.making.scenes import plane_rig

RIG = plane_rig((0.6, 0.3, 0.0))
FRAMES = drive(RIG, 2)
UNITS = {"<i2": (3, 0.01), "<i4": (5, 0.001), "<f4": (7, 0.001)}


def in_units(kind: str, unit_m: float):
    def cloud(maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int) -> tuple[str, bytes]:
        made = maker.store.types["sensor_msgs/msg/PointField"]
        size = int(kind[-1])
        values = xyz_m / unit_m
        data = (values if kind == "<f4" else np.round(values)).astype(kind)
        message = maker._made(
            schemas.POINT_CLOUD,
            header=maker.header(stamp_ns, "lidar"),
            height=1,
            width=len(data),
            fields=[made(name=n, offset=size * i, datatype=UNITS[kind][0], count=1) for i, n in enumerate("xyz")],
            is_bigendian=False,
            point_step=3 * size,
            row_step=3 * size * len(data),
            data=data.reshape(-1).view(np.uint8),
            is_dense=True,
        )
        return schemas.POINT_CLOUD, maker.serialise(schemas.POINT_CLOUD, message)

    return cloud


def read(path: Path, rig_file: Path) -> list[Frame]:
    with open_recording(path) as recording:
        [found] = rigs_through(recording, survey(recording), rig_file).rigs
        stream = synchronise(recording, found.rig, found.survey)
        frames = list(stream)
        assert all(topic.adds_up for topic in stream.balance)
    return frames


@pytest.mark.parametrize("kind", UNITS)
def test_points_in_a_unit_that_the_rig_file_says_are_those_in_metres(tmp_path: Path, kind: str) -> None:
    unit_m = UNITS[kind][1]
    path = ros(cloud=in_units(kind, unit_m))(tmp_path, RIG, FRAMES)
    with open_recording(path) as recording:
        [unreadable] = survey(recording).unreadable
        assert "whole numbers" in unreadable.reason or "not metres" in unreadable.reason
    assert RIG.lidar
    write_rig(replace(RIG, lidar=replace(RIG.lidar, unit_m=unit_m)), tmp_path / "rig.toml")
    frames = read(path, tmp_path / "rig.toml")
    assert len(frames) == len(FRAMES)
    for frame, written in zip(frames, FRAMES, strict=True):
        assert np.abs(frame.cloud.xyz_m - written.cloud.xyz_m).max() <= 0.51 * unit_m


def test_a_unit_is_a_property_of_the_rig() -> None:
    assert RIG.lidar
    scaled = replace(RIG, lidar=replace(RIG.lidar, unit_m=0.01))
    assert scaled.rig_id != RIG.rig_id
    assert scaled.from_dict(scaled.to_dict()).lidar.unit_m == 0.01
    for wrong in (0, -1, "cm", True, float("nan")):
        described = scaled.to_dict()
        described["lidar"]["unit_m"] = wrong
        with pytest.raises(RigError, match="unit_m of the LiDAR should be a number above 0"):
            scaled.from_dict(described)

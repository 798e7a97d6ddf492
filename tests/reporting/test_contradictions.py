"""What a page says of LiDARs that contradict each other: where, in how many frames, and what cameras say of it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auditor.model.optics.geometry import motion
from auditor.model.rig import Camera, Lidar, Rig
from auditor.reporting.incident.cameras_beside import CameraRig, beside, camera_rigs
from auditor.reporting.incident.contradictions import Contradiction, contradictions
from tests.making.several_lidars import BUMPER, ROOF, rig_of
from tests.making.stores import PERIOD_NS, add_judgement, add_measurement, make_measurement, make_rig, new_store

RIG = rig_of(ROOF, BUMPER)


def told(*places_m: Sequence[float], size_m: Sequence[float] = (1.8, 0.8, 0.1)) -> Contradiction:
    """Of S_1, by S_0, with the middle of a thing in each frame: ahead, to the left and up of the LiDAR."""
    rows = [
        {"sensor": 1, "by": [0], "frame": frame, "centre_m": place, "size_m": size_m, "points": 80}
        for frame, place in enumerate(places_m)
    ]
    [one] = contradictions(rows, RIG, range(len(rows)), ())
    return one


@pytest.mark.parametrize(
    ("place_m", "said"),
    [
        ((12.0, 0.0, 0.5), "12.0 m ahead of it, 1.8 m wide, from 0.1 m above to 0.9 m above it"),
        ((9.0, 2.5, -0.6), "9.0 m ahead of it and 2.5 m to the left, 1.8 m wide, from 1.0 m below to 0.2 m below it"),
        ((-4.0, -1.0, 0.2), "4.0 m behind it and 1.0 m to the right, 1.8 m wide, from 0.2 m below to 0.6 m above it"),
    ],
)
def test_the_place_is_said_as_seen_from_the_lidar(place_m: tuple[float, float, float], said: str) -> None:
    assert told(place_m).where == said


def test_what_keeps_its_place_beside_the_vehicle_is_told_from_what_passes() -> None:
    assert told((8.0, 0.0, 0.0), (8.3, 0.1, 0.0)).stays
    assert not told((8.0, 0.0, 0.0), (4.0, 0.0, 0.0)).stays
    assert not told((8.0, 0.0, 0.0)).stays


def test_only_frames_of_the_incident_and_attacked_sensors_count_those_of_most_frames_first() -> None:
    def row(sensor: int, by: list[int], frame: int) -> dict[str, Any]:
        place = {"centre_m": (8.0, 0, 0), "size_m": (1, 1, 1), "points": 9}
        return {"sensor": sensor, "by": by, "frame": frame, **place}

    rows = [row(0, [1], 1), row(1, [0, 1], 1), row(1, [0], 2), row(1, [0], 9)]
    every = contradictions(rows, RIG, {1, 2}, ())
    assert [(one.sensor, one.frames, one.others, one.by_past) for one in every] == [
        (1, 2, {0: 2}, 1),
        (0, 1, {1: 1}, 0),
    ]
    assert [one.sensor for one in contradictions(rows, RIG, {1, 2}, (0,))] == [0]


def camera(name: str, number: int, right_m: float) -> Camera:
    projection = np.array([[300.0, 0, 160, -300 * right_m], [0, 300, 60, 0], [0, 0, 1, 0]])
    return Camera(number, name, f"/{name}", 320, 120, projection, rectified=True)


WITH_CAMERAS = Rig(
    Lidar("roof", RIG.topic(0), motion(RIG.lidars[0].rig_SE3_lidar[:3, :3], np.zeros(3))),
    (camera("right", 1, 0.3), camera("left", 2, -0.3)),
)


@pytest.mark.parametrize(
    ("place_m", "cameras"), [((12.0, 0.0, 1.0), ("right", "left")), ((5.0, 9.0, 1.0), ()), ((-12.0, 0.0, 1.0), ())]
)
def test_cameras_whose_pictures_show_the_place_are_named(
    tmp_path: Path, place_m: tuple[float, float, float], cameras: tuple[str, ...]
) -> None:
    store = new_store(tmp_path)
    one = CameraRig("0" * 32, WITH_CAMERAS, 0)
    [said] = beside(store, RIG, [one], [told(place_m)], 0, 10)
    assert (said.sensor, said.audited, said.named, said.cameras) == (0, 0, 0, cameras)


def test_the_verdicts_of_the_cameras_count_in_the_seconds_of_the_incident(tmp_path: Path) -> None:
    store, frames = new_store(tmp_path), range(8)
    measurement_id = add_measurement(store, WITH_CAMERAS, [make_measurement(WITH_CAMERAS, n) for n in frames])
    add_judgement(store, WITH_CAMERAS, measurement_id, "0000cn0c")
    [found] = camera_rigs(store, store.measurement(measurement_id).recording_id, RIG)
    assert (found.measurement_id, found.sensor) == (measurement_id, 0)
    [said] = beside(store, RIG, [found], [told((12.0, 0.0, 1.0))], 3 * PERIOD_NS, 6 * PERIOD_NS)
    assert (said.audited, said.named) == (3, 2)


def test_cameras_that_are_compared_with_none_of_the_lidars_say_nothing(tmp_path: Path) -> None:
    store, other = new_store(tmp_path), make_rig(2)
    measurement_id = add_measurement(store, other, [make_measurement(other, 0)])
    assert camera_rigs(store, store.measurement(measurement_id).recording_id, RIG) == []

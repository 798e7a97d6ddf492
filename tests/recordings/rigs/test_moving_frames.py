"""Points that were put into a frame in which the vehicle moves are no sensor's own."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix
from auditor.recordings import search_rigs
from auditor.recordings.decoding import Transform
from auditor.recordings.synchronisation.descriptions import Mountings
from auditor.recordings.synchronisation.survey import Survey
from tests.recordings.rigs.test_discovery import LIDAR_AT, P, at, info, look

INFOS = {"left": info("left", P(0.0)), "right": info("right", P(0.5))}
PLACES = {"left": at(0), "right": at(0.5), "top": LIDAR_AT}


def surveyed(clouds: Mapping[str, int], *links: tuple[str, str]) -> Survey:
    """Cameras and clouds on `base`, and a frame `world` above it; `links` move."""
    survey = look(INFOS, PLACES, clouds=dict(clouds))
    above = Transform("world", "base", at(100.0))
    return replace(survey, transforms=(*survey.transforms, above), moving=frozenset(links))


def test_the_cloud_in_the_lidars_own_frame_goes_before_its_copy_in_a_moving_one() -> None:
    found = search_rigs(surveyed({"top": 1000, "world": 5000}, ("world", "base")))
    [rig] = found.rigs
    assert rig.lidar
    assert rig.lidar.name == "top"
    [why] = [one for one in found.left_out if one.of == "/world/points"]
    assert "put into the frame 'world', in which the vehicle moves" in str(why)


def test_a_cloud_in_a_frame_that_does_not_move_may_be_any_lidars() -> None:
    rigs = search_rigs(surveyed({"top": 1000, "world": 5000})).rigs
    assert "world" in {rig.lidar.name for rig in rigs if rig.lidar}


def test_a_cloud_that_has_no_copy_in_a_sensors_frame_is_left_out_all_the_same() -> None:
    found = search_rigs(surveyed({"world": 5000}, ("world", "base")))
    assert not found.rigs
    assert any("in which the vehicle moves" in reason for reason in found.reasons)


def test_a_lidar_that_turns_on_the_vehicle_is_a_sensor() -> None:
    """Its frame is the child of what moves, as those of sensors are."""
    found = search_rigs(surveyed({"top": 1000}, ("base", "top")))
    assert [rig.lidar.name for rig in found.rigs if rig.lidar] == ["top"]


class _Decoder:
    """Gives the transforms of a message, which has them as they are."""

    kind = "transforms"

    def __init__(self, transforms: list[Transform]) -> None:
        self._transforms = transforms

    def transforms(self, _: Message) -> tuple[Transform, ...]:
        return tuple(self._transforms)


def moving(places: list[Matrix], parent: str = "world", topic: str = "/tf") -> frozenset[tuple[str, str]]:
    mountings = Mountings()
    for time_ns, place in enumerate(places):
        message = Message(topic, "tf2_msgs/msg/TFMessage", "cdr", time_ns, memoryview(b""))
        assert not list(mountings.take(message, _Decoder([Transform(parent, "base", place)])))
    return mountings.moving()


def turned(radians: float) -> Matrix:
    place = at(0)
    place[:2, :2] = [[np.cos(radians), -np.sin(radians)], [np.sin(radians), np.cos(radians)]]
    return place


@pytest.mark.parametrize(
    ("places", "moves"),
    [
        ([at(0.02 * n) for n in range(40)], True),
        ([turned(0.02 * n) for n in range(40)], True),
        ([at(0.001 * (n % 2)) for n in range(40)], False),
        ([at(0), *(at(2.0) for _ in range(40))], False),
    ],
    ids=["drives", "turns", "is measured anew", "is put right once"],
)
def test_a_frame_moves_that_goes_on_and_on(places: list[Matrix], moves: bool) -> None:
    assert moving(places) == (frozenset({("world", "base")}) if moves else frozenset())


def test_the_vehicle_may_move_in_odom_and_map_also_while_it_stands() -> None:
    assert moving([at(0)] * 3, "odom") == {("odom", "base")}
    assert not moving([at(0)] * 3, "odom", "/tf_static")


def test_of_transforms_that_go_round_the_first_count() -> None:
    mountings = Mountings()
    message = Message("/tf_static", "tf2_msgs/msg/TFMessage", "cdr", 0, memoryview(b""))
    links = [
        ("base", "mast"),
        ("mast", "left"),
        ("left", "base"),
        ("mast", "base"),
        ("left", "left"),
        ("base", "right"),
    ]
    told = list(mountings.take(message, _Decoder([Transform(*link, at(1.0)) for link in links])))
    assert [(one.parent, one.child) for one in mountings.all()] == [*links[:2], links[-1]]
    assert [one.partition(":")[0] for one in told] == ["left to base", "mast to base", "left to left"]

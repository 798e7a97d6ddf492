"""Which LiDARs of a recording are compared with each other."""

from collections.abc import Mapping

import numpy as np
import pytest

from auditor.model.arrays import Points
from auditor.model.optics.geometry import Matrix, motion
from auditor.recordings import find_rigs
from auditor.recordings.decoding import Transform
from auditor.recordings.parameters import LIDAR_OVERLAP
from auditor.recordings.recording import Topic
from auditor.recordings.rigs.lidars import is_part_of
from auditor.recordings.synchronisation.survey import CloudTopic, Sample, Survey

SECOND_NS = 10**9


def around(*, ahead: bool = True, behind: bool = True) -> Points:
    """Points on a circle 20 m away, or on half of it."""
    azimuth = np.concatenate([np.linspace(-1.5, 1.5, 200)[: 200 * ahead], np.linspace(1.7, 4.5, 200)[: 200 * behind]])
    return np.stack([20 * np.cos(azimuth), 20 * np.sin(azimuth), 0 * azimuth], axis=1).astype(np.float32)


def at(x: float) -> Matrix:
    return motion(np.eye(3), np.array([x, 0.0, 1.0]))


def cloud(name: str, points: int, some_m: Points, *, hz: float = 10, frame: str = "") -> CloudTopic:
    stamps = [int(number * SECOND_NS / hz) for number in range(1, 6)]
    samples = tuple(Sample(stamp, stamp) for stamp in stamps)
    topic = Topic(f"/{name}/points", "sensor_msgs/msg/PointCloud2", "cdr")
    return CloudTopic(topic, frame or name, points, samples, some_m=some_m)


def lidars_of(clouds: list[CloudTopic], places: Mapping[str, Matrix]) -> list[list[str]]:
    """The names of the LiDARs of each rig."""
    survey = Survey(
        topics=tuple(one.topic for one in clouds),
        images=(),
        clouds=tuple(clouds),
        camera_infos={},
        transforms=tuple(Transform("base_link", child, place) for child, place in places.items()),
        problems=(),
        interleaved=True,
    )
    return [[lidar.name for lidar in rig.lidars.values()] for rig in find_rigs(survey)]


def test_lidars_that_see_the_same_things_are_one_rig_and_the_larger_is_its_first() -> None:
    clouds = [cloud("bumper", 100, around(behind=False)), cloud("roof", 200, around())]
    assert lidars_of(clouds, {"roof": at(0), "bumper": at(2)}) == [["roof", "bumper"]]


@pytest.mark.parametrize(
    ("clouds", "places"),
    [
        ([cloud("a", 2, around()), cloud("b", 1, around())], {"a": at(0)}),
        ([cloud("a", 2, around()), cloud("b", 1, around())], {"a": at(0), "b": at(40)}),
        ([cloud("a", 2, around(behind=False)), cloud("b", 1, around(ahead=False))], {"a": at(0), "b": at(1)}),
        ([cloud("a", 2, around()), cloud("b", 1, around(), hz=5)], {"a": at(0), "b": at(1)}),
        ([cloud("a", 2, around()), cloud("b", 1, around(), frame="base_link")], {"a": at(0)}),
    ],
    ids=["no place", "far away", "looks elsewhere", "slow", "points of the body's frame"],
)
def test_lidars_that_cannot_be_compared_are_each_alone(clouds: list[CloudTopic], places: Mapping[str, Matrix]) -> None:
    assert lidars_of(clouds, places) == [["a"], ["b"]]


def test_a_chain_of_lidars_is_one_rig_and_two_topics_of_one_lidar_are_one_sensor() -> None:
    clouds = [
        cloud("ahead", 3, around(behind=False)),
        cloud("behind", 2, around(ahead=False)),
        cloud("roof", 4, around()),
        cloud("filtered", 1, around(), frame="roof"),
    ]
    assert lidars_of(clouds, {"ahead": at(1), "behind": at(-1), "roof": at(0)}) == [["roof", "ahead", "behind"]]


@pytest.mark.parametrize(
    ("some_m", "is_part"),
    [
        (around()[::4], True),
        (around(behind=False), True),
        (around(ahead=False), True),
        (1.5 * around(behind=False), False),
        (np.concatenate([around(behind=False), 0.5 * around(ahead=False)]), False),
    ],
    ids=["thinned", "ahead", "behind", "farther away", "half of it nearer"],
)
def test_a_topic_is_a_part_of_another_in_its_frame_where_all_its_points_lie_beside(
    some_m: Points, is_part: bool
) -> None:
    assert is_part_of(cloud("a", 1, some_m), cloud("b", 2, around())) is is_part


def test_a_rig_has_a_bounded_number_of_lidars() -> None:
    clouds = [cloud(f"l{number}", 100 - number, around()) for number in range(LIDAR_OVERLAP.most + 2)]
    found = lidars_of(clouds, {one.frame_id: at(0) for one in clouds})
    assert [len(names) for names in found] == [LIDAR_OVERLAP.most, 2]

"""Two vehicles in one recording, with topics below a name of their own and coordinate frames of the same names."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.model.coverage import TopicState
from auditor.model.frames import Frame, Message
from auditor.model.rig import Rig
from auditor.recordings import open_recording, rigs_in_force, schemas, search_rigs, survey, synchronise
from auditor.recordings.rigs.left_out import AtOnePlace
from auditor.recordings.synchronisation.vehicles import sharing_frames
from auditor.recordings.writers.messages import MessageMaker
from tests.making.recorded_drives import PERIOD_NS, START_NS, make_frame, make_rig
from tests.making.split_drives import SUFFIXES, messages_of, write_messages

RIG = make_rig(2)


def frames(rig: Rig, numbers: Iterable[int]) -> list[Frame]:
    return [make_frame(rig, number, stamp_ns=START_NS + number * PERIOD_NS) for number in numbers]


def wider(rig: Rig) -> Rig:
    """The rig with cameras twice as far apart."""
    apart = (replace(one, projection=one.projection * np.array([1, 1, 1, 2])) for one in rig.cameras)
    return replace(rig, cameras=tuple(apart))


def below(space: str, messages: Iterable[Message], *, tf: bool = True) -> Iterator[Message]:
    """Messages of one vehicle; their frames stay as they are."""
    for one in messages:
        yield one if one.schema == schemas.TRANSFORMS and not tf else replace(one, topic=f"/{space}{one.topic}")


def two(path: Path, *, tf: bool, more: Iterable[Message] = ()) -> Path:
    first, other = (messages_of(path.suffix, rig, frames(rig, range(5))) for rig in (RIG, wider(RIG)))
    messages = [*below("one", first, tf=tf), *below("two", other, tf=tf), *more]
    return write_messages(path, sorted(messages, key=lambda message: message.log_time_ns))


def baselines_m(rigs: Iterable[Rig]) -> dict[str, float]:
    """The distance of the cameras of each rig, by the namespace of all of its sensors."""
    found = {}
    for rig in rigs:
        [space] = {rig.topic(sensor).split("/")[1] for sensor in rig.sensors}
        found[space] = float(np.ptp([camera.centre_m[0] for camera in rig.cameras]))
    return found


def alone(folder: Path, suffix: str) -> Rig:
    messages = below("one", messages_of(suffix, RIG, frames(RIG, range(5))))
    with open_recording(write_messages(folder / f"one{suffix}", list(messages))) as recording:
        [rig] = search_rigs(survey(recording)).rigs
    return rig


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_each_vehicle_is_placed_by_the_tf_below_its_own_name(tmp_path: Path, suffix: str) -> None:
    [apart] = baselines_m([alone(tmp_path, suffix)]).values()
    with open_recording(two(tmp_path / f"two{suffix}", tf=True)) as recording:
        surveyed = survey(recording)
        found = rigs_in_force(recording, surveyed)
    assert baselines_m(one.rig for one in found.rigs) == pytest.approx({"one": apart, "two": 2 * apart})
    assert not found.remarks
    assert not any("same names" in why for why in search_rigs(surveyed).reasons)


def test_a_mounting_that_moves_changes_the_rig_of_its_own_vehicle_alone(tmp_path: Path) -> None:
    assert RIG.lidar is not None
    moved = RIG.lidar.rig_SE3_lidar.copy()
    moved[:3, 3] += 0.2
    later = messages_of(".mcap", replace(RIG, lidar=replace(RIG.lidar, rig_SE3_lidar=moved)), frames(RIG, [3]))
    tf = [one for one in below("two", later) if one.schema == schemas.TRANSFORMS]
    with open_recording(two(tmp_path / "moves.mcap", tf=True, more=tf)) as recording:
        found = rigs_in_force(recording, survey(recording))
    assert [one.rig.topic(0) for one in found.rigs] == ["/one/top/points", "/two/top/points", "/two/top/points"]


def without_offsets(message: Message) -> Message:
    """A camera info whose P has no offset, so that tf alone gives positions; any other message as it is."""
    if message.schema != schemas.CAMERA_INFO:
        return message
    P = np.array([[50.0, 0, 32, 0], [0, 50, 24, 0], [0, 0, 1, 0]])
    data = MessageMaker("cdr").camera_info(P, 64, 48, message.log_time_ns, message.topic.split("/")[2])
    return replace(message, data=data)


def test_one_tf_for_vehicles_with_the_same_frames_is_said_to_be_the_reason(tmp_path: Path) -> None:
    with open_recording(two(tmp_path / "offsets.mcap", tf=False)) as recording:
        messages = [without_offsets(one) for one in recording.messages()]
    with open_recording(write_messages(tmp_path / "two.mcap", messages)) as recording:
        surveyed = survey(recording)
        found = search_rigs(surveyed)
        stream = synchronise(recording, found.rigs[0], surveyed)
        assert list(stream)
    states = {one.topic: one.state for one in stream.coverage}
    assert {states[topic] for topic in states if topic.startswith("/two")} == {TopicState.NOT_COMPARED}
    [why] = [one for one in found.left_out if "/one, /two have coordinate frames of the same names" in str(one)]
    assert "/one/tf_static" in str(why)
    assert why.tells_of("cam1")


def test_of_two_cameras_of_one_name_at_one_place_the_topics_are_said() -> None:
    left, right = RIG.cameras[:2]
    assert str(AtOnePlace(left, right)) == f"{left.name} lies where {right.name} lies"
    assert str(AtOnePlace(replace(left, topic="/two/left"), left)) == f"/two/left lies where {left.topic} lies"


def test_two_cameras_of_one_frame_are_of_one_vehicle() -> None:
    stereo = [("/left/image_raw", "head"), ("/right/image_raw", "head"), ("/points", "lidar")]
    assert sharing_frames(stereo) == ()
    assert sharing_frames([(f"/{space}{topic}", name) for space in "ab" for topic, name in stereo]) == ("a", "b")

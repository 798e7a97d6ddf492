"""Calibrations that change within a recording: which rig is in force when, and what is told."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

from auditor.model.frames import CameraImage, Frame, Message, SkippedFrame
from auditor.model.optics.geometry import motion
from auditor.model.rig import Rig
from auditor.recordings import open_recording, rigs_in_force, schemas, survey, synchronise
from auditor.recordings.decoding import CameraInfo
from auditor.recordings.decoding.interface import Header
from auditor.recordings.parameters import CALIBRATION_CHANGES
from auditor.recordings.rigs.calibrations import same_camera_info
from auditor.recordings.rigs.in_force import CHANGING, NO_RIG, TOO_OFTEN, RigsInForce
from auditor.recordings.writers.messages import MessageMaker
from tests.making.foxglove_messages import FoxgloveMessage, write_json, write_protobuf
from tests.making.foxglove_messages import messages_of as foxglove_messages
from tests.making.recorded_drives import PERIOD_NS, START_NS, make_frame, make_rig
from tests.making.split_drives import SUFFIXES, messages_of, write_messages

RIG = make_rig(2)
MAKER = MessageMaker("cdr")


def zoomed(rig: Rig, factor: float, *, only: int | None = None) -> Rig:
    """The rig with another focal length, of all cameras or of one."""
    scale = np.diag([factor, factor, 1.0])
    return replace(
        rig,
        cameras=tuple(
            replace(camera, projection=scale @ camera.projection) if only in {None, camera.number} else camera
            for camera in rig.cameras
        ),
    )


def with_lidar_moved(rig: Rig, metres: float) -> Rig:
    assert rig.lidar
    at = rig.lidar.rig_SE3_lidar.copy()
    at[0, 3] += metres
    return replace(rig, lidar=replace(rig.lidar, rig_SE3_lidar=at))


def frames(numbers: Iterable[int], rig: Rig = RIG, *, every: int = 1) -> list[Frame]:
    return [make_frame(rig, number, stamp_ns=START_NS + every * number * PERIOD_NS) for number in numbers]


def changing(path: Path, *parts: tuple[Rig, Iterable[int]], every: int = 1, more: Iterable[Message] = ()) -> Path:
    """A recording whose calibration is that of a rig for some frames, then that of another one."""
    messages = [
        message
        for rig, numbers in parts
        for message in messages_of(path.suffix, rig, frames(numbers, rig, every=every))
    ]
    return write_messages(path, sorted([*messages, *more], key=lambda message: message.log_time_ns))


def seen(path: Path) -> tuple[RigsInForce, list[list[Frame]], list[list[SkippedFrame]]]:
    """What is in force, and by rig its frames and what is skipped."""
    with open_recording(path) as recording:
        found = rigs_in_force(recording, survey(recording))
        streams = [synchronise(recording, one.rig, one.survey, stretches=one.stretches) for one in found.rigs]
        made = [list(stream) for stream in streams]
        assert all(topic.adds_up for stream in streams for topic in stream.balance)
    there = [[item for item in items if isinstance(item, Frame)] for items in made]
    skipped = [[item for item in items if isinstance(item, SkippedFrame)] for items in made]
    return found, there, skipped


def numbers(items: Iterable[Frame | SkippedFrame]) -> list[int]:
    return [item.number for item in items]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_frames_behind_a_change_have_a_rig_of_their_own(tmp_path: Path, suffix: str) -> None:
    path = changing(tmp_path / f"a{suffix}", (RIG, range(10)), (zoomed(RIG, 1.1), range(10, 20)))
    found, there, skipped = seen(path)
    assert [numbers(one) for one in there] == [[*range(10)], [*range(10, 20)]]
    assert skipped == [[], []]
    assert [frame.stamp_ns for frame in there[1]] == [START_NS + number * PERIOD_NS for number in range(10, 20)]
    assert [one.rig.cameras[0].focal_px for one in found.rigs] == pytest.approx([50, 55])
    (told,) = found.remarks
    assert "changes at 1.0 s" in told
    assert "/cam1/camera_info" in told


def test_nothing_changes_in_a_recording_that_repeats_its_calibration(tmp_path: Path) -> None:
    path = changing(tmp_path / "a.mcap", (RIG, range(5)), (zoomed(RIG, 1 + 1e-8), range(5, 10)), (RIG, range(10, 15)))
    found, there, _ = seen(path)
    assert [numbers(one) for one in there] == [[*range(15)]]
    assert found.remarks == ()


@pytest.mark.parametrize(
    "wandering",
    [
        pytest.param(lambda to: zoomed(RIG, 1 + 1e-3 * to), id="0.05 px of the focal length"),
        pytest.param(lambda to: with_lidar_moved(RIG, 4e-4 * to), id="0.4 mm of a place"),
    ],
)
def test_a_calibration_that_wanders_by_less_than_a_tenth_of_a_pixel_is_one(
    tmp_path: Path, wandering: Callable[[float], Rig]
) -> None:
    parts = [(wandering(np.sin(number)), [number]) for number in range(20)]
    found, there, skipped = seen(changing(tmp_path / "a.mcap", *parts))
    assert [numbers(one) for one in there] == [[*range(20)]]
    assert skipped == [[]]
    assert found.remarks == ()


def test_small_steps_in_one_direction_are_a_change_once_they_are_a_large_one(tmp_path: Path) -> None:
    parts = [(with_lidar_moved(RIG, 1e-4 * number), [number]) for number in range(15)]
    found, there, _ = seen(changing(tmp_path / "a.mcap", *parts))
    assert [numbers(one) for one in there] == [[*range(11)], [*range(11, 15)]]
    assert len(found.remarks) == 1


def test_a_calibration_that_comes_back_almost_has_the_rig_of_before(tmp_path: Path) -> None:
    parts = (RIG, range(15)), (zoomed(RIG, 1.1), range(15, 30)), (zoomed(RIG, 1.0005), range(30, 45))
    _, there, _ = seen(changing(tmp_path / "a.mcap", *parts))
    assert [numbers(one) for one in there] == [[*range(15), *range(30, 45)], [*range(15, 30)]]


@pytest.mark.parametrize("same", [True, False])
@pytest.mark.parametrize(
    ("field", "by"),
    [
        ("intrinsics", 0.05 * np.eye(3)),
        ("projection", 0.05 * np.eye(3, 4)),
        ("projection", np.eye(3, 4, 3) * 0.5),
        ("rotation", np.full((3, 3), 5e-5)),
        ("distortion", np.full(5, 5e-5)),
    ],
)
def test_two_camera_infos_are_one_where_no_pixel_moves_by_a_tenth(field: str, by: np.ndarray, same: bool) -> None:
    K = np.diag([1000.0, 1000.0, 1.0])
    info = CameraInfo(Header(0, "cam"), 640, 480, (0.1, 0.0, 0.0, 0.0, 0.0), K, np.eye(3), np.eye(3, 4) * 1000)
    other = replace(info, **{field: getattr(info, field) + by * (1 if same else 4)})
    assert same_camera_info(info, other) == same


def test_a_mounting_that_moves_is_a_change(tmp_path: Path) -> None:
    path = changing(tmp_path / "a.mcap", (RIG, range(10)), (with_lidar_moved(RIG, 0.2), range(10, 20)))
    found, there, _ = seen(path)
    assert [numbers(one) for one in there] == [[*range(10)], [*range(10, 20)]]
    assert "tf from rig to top" in found.remarks[0]


def odometry(count: int) -> list[Message]:
    moves = [np.eye(4) for _ in range(count)]
    for number, move in enumerate(moves):
        move[0, 3] = number
    times = [START_NS + number * PERIOD_NS for number in range(count)]
    return [
        Message("/tf", schemas.TRANSFORMS, "cdr", time, MAKER.transforms("odom", {"rig": move}, time))
        for time, move in zip(times, moves, strict=True)
    ]


def test_frames_that_move_and_sensors_outside_the_rig_do_not_count(tmp_path: Path) -> None:
    other = [
        Message(
            "/rear/camera_info",
            schemas.CAMERA_INFO,
            "cdr",
            START_NS + number * PERIOD_NS,
            MAKER.camera_info((number + 1) * RIG.cameras[0].projection, 64, 48, START_NS + number * PERIOD_NS, "rear"),
        )
        for number in range(10)
    ]
    found, there, _ = seen(changing(tmp_path / "a.mcap", (RIG, range(10)), more=[*odometry(10), *other]))
    assert [numbers(one) for one in there] == [[*range(10)]]
    assert found.remarks == ()


def test_cameras_that_change_one_after_the_other_change_once(tmp_path: Path) -> None:
    path = changing(
        tmp_path / "a.mcap",
        (RIG, range(10)),
        (zoomed(RIG, 1.1, only=1), range(10, 13)),
        (zoomed(RIG, 1.1), range(13, 20)),
    )
    found, there, skipped = seen(path)
    assert [numbers(one) for one in there] == [[*range(10)], [*range(13, 20)]]
    assert [(item.number, item.reason) for item in skipped[0]] == [(number, CHANGING) for number in (10, 11, 12)]
    (told,) = found.remarks
    assert "changes at 1.0 s, and again until 1.3 s" in told
    assert "frames between are not audited, which --rig avoids" in told


def test_a_calibration_that_comes_back_has_the_rig_of_before(tmp_path: Path) -> None:
    path = changing(tmp_path / "a.mcap", (RIG, range(15)), (zoomed(RIG, 1.1), range(15, 30)), (RIG, range(30, 45)))
    found, there, _ = seen(path)
    assert [numbers(one) for one in there] == [[*range(15), *range(30, 45)], [*range(15, 30)]]
    assert "the rig of before" in found.remarks[1]
    with open_recording(path) as recording:
        for one in found.rigs:
            stream = synchronise(recording, one.rig, one.survey, stretches=one.stretches)
            list(stream)
            assert all(topic.time is None or topic.time.held_ns == topic.time.covered_ns for topic in stream.coverage)


def test_more_changes_than_are_accepted_leave_the_rest_unaudited(tmp_path: Path) -> None:
    most = CALIBRATION_CHANGES.most
    rigs = [zoomed(RIG, 1.0 + 0.1 * (number % 2)) for number in range(most + 3)]
    each = 4
    path = changing(
        tmp_path / "a.mcap",
        *((rig, range(each * number, each * number + each)) for number, rig in enumerate(rigs)),
        every=3,
    )
    found, there, skipped = seen(path)
    audited = sorted(number for one in there for number in numbers(one))
    assert audited == [*range(each * (most + 1))]
    left = [item for items in skipped for item in items]
    assert numbers(left) == [*range(each * (most + 1), each * (most + 3))]
    assert {item.reason for item in left} == {TOO_OFTEN}
    assert "are not audited" in found.remarks[-1]


def test_calibrations_that_alternate_without_rest_leave_their_time_unaudited(tmp_path: Path) -> None:
    parts = [(zoomed(RIG, 1.0 + 0.1 * (number % 2)), [number]) for number in range(10, 31)]
    found, there, skipped = seen(changing(tmp_path / "a.mcap", (RIG, range(10)), *parts))
    assert numbers(there[0])[:10] == [*range(10)]
    assert {item.reason for items in skipped for item in items} == {CHANGING}
    assert len([item for items in skipped for item in items]) == 19
    assert found.remarks


def without_infos(messages: Iterable[Message]) -> list[Message]:
    """Messages whose camera infos hold zeros."""
    return [
        replace(m, data=MAKER.camera_info(np.zeros((3, 4)), 64, 48, m.log_time_ns, m.topic[1:5]))
        if m.schema == schemas.CAMERA_INFO
        else m
        for m in messages
    ]


@pytest.mark.parametrize(("blank", "said"), [(1, "its first info is zeros"), (3, "its first 3 infos are zeros")])
def test_infos_of_zeros_before_the_first_other_one_say_nothing(tmp_path: Path, blank: int, said: str) -> None:
    each = [messages_of(".mcap", RIG, frames([number])) for number in range(10)]
    first = [without_infos(messages) for messages in each[:blank]]
    found, there, skipped = seen(write_messages(tmp_path / "a.mcap", chain(*first, *each[blank:])))
    assert [numbers(one) for one in there] == [[*range(10)]]
    assert skipped == [[]]
    assert len(found.remarks) == 2
    assert all(said in remark for remark in found.remarks)


def test_a_change_that_leaves_no_rig_leaves_the_rest_unaudited(tmp_path: Path) -> None:
    first = messages_of(".mcap", RIG, frames(range(10)))
    rest = messages_of(".mcap", RIG, frames(range(10, 20)))
    found, there, skipped = seen(write_messages(tmp_path / "a.mcap", [*first, *without_infos(rest)]))
    assert [numbers(one) for one in there] == [[*range(10)]]
    assert [(item.number, item.reason) for item in skipped[0]] == [(number, NO_RIG) for number in range(10, 20)]
    assert "have no rig" in found.remarks[0]


def test_a_calibration_that_changed_before_the_first_frame_was_never_in_force(tmp_path: Path) -> None:
    early = [
        message
        for message in messages_of(".mcap", RIG, [make_frame(RIG, 0, stamp_ns=START_NS - 10 * PERIOD_NS)])
        if message.schema in {schemas.CAMERA_INFO, schemas.TRANSFORMS}
    ]
    found, there, skipped = seen(changing(tmp_path / "a.mcap", (zoomed(RIG, 1.1), range(10)), more=early))
    assert [numbers(one) for one in there] == [[*range(10)]]
    assert skipped == [[]]
    assert found.rigs[0].rig.cameras[0].focal_px == pytest.approx(55)
    assert len(found.remarks) == 1


def smaller(frame: Frame, rig: Rig) -> Frame:
    """The frame with pictures of the sizes of another rig."""
    images = {
        number: CameraImage(number, image.stamp_ns, image.pixels[: rig.camera(number).height_px])
        for number, image in frame.images.items()
    }
    return replace(frame, images=images)


def test_pictures_of_another_size_are_a_change(tmp_path: Path) -> None:
    small = replace(RIG, cameras=tuple(replace(camera, height_px=40) for camera in RIG.cameras))
    messages = messages_of(".mcap", RIG, frames(range(10)))
    messages += messages_of(".mcap", small, [smaller(frame, small) for frame in frames(range(10, 20))])
    found, there, _ = seen(write_messages(tmp_path / "a.mcap", messages))
    assert [numbers(one) for one in there] == [[*range(10)], [*range(10, 20)]]
    assert [one.rig.cameras[0].height_px for one in found.rigs] == [48, 40]
    assert "the picture size of /cam1/image_rect" in found.remarks[0]


def test_one_picture_of_another_size_is_damaged_and_no_change(tmp_path: Path) -> None:
    small = replace(RIG, cameras=tuple(replace(camera, height_px=40) for camera in RIG.cameras))
    odd = [
        message
        for message in messages_of(".mcap", small, [smaller(frames([5])[0], small)])
        if message.topic == "/cam1/image_rect"
    ]
    whole = [
        message
        for message in messages_of(".mcap", RIG, frames(range(10)))
        if (message.topic, message.log_time_ns) != (odd[0].topic, odd[0].log_time_ns)
    ]
    path = write_messages(tmp_path / "a.mcap", sorted([*whole, *odd], key=lambda message: message.log_time_ns))
    found, there, skipped = seen(path)
    assert len(found.rigs) == 1
    assert not found.remarks
    assert numbers(there[0]) == [0, 1, 2, 3, 4, 6, 7, 8, 9]
    assert numbers(skipped[0]) == [5]


@pytest.mark.parametrize("write", [write_protobuf, write_json])
def test_foxglove_calibrations_change_as_those_of_ros(
    tmp_path: Path, write: Callable[[Path, Iterator[FoxgloveMessage]], None]
) -> None:
    parts = foxglove_messages(RIG, frames(range(5))), foxglove_messages(zoomed(RIG, 1.1), frames(range(5, 10)))
    write(tmp_path / "a.mcap", chain(*parts))
    found, there, _ = seen(tmp_path / "a.mcap")
    assert [numbers(one) for one in there] == [[*range(5)], [*range(5, 10)]]
    assert len(found.remarks) == 1


def test_a_rig_beside_the_one_that_changes_keeps_all_its_frames(tmp_path: Path) -> None:
    rear = Rig(
        None,
        tuple(replace(c, name=f"rear{c.number}", topic=f"/rear{c.number}/image_rect") for c in make_rig(3).cameras),
    )
    ahead = make_rig(3, lidar=False)
    turned = motion(np.diag([-1.0, 1.0, -1.0]), np.zeros(3))
    both = [
        [*messages_of(".mcap", rig, frames(range(first, first + 5), rig)), *_behind(rear, turned, first)]
        for rig, first in ((ahead, 0), (zoomed(ahead, 1.1), 5))
    ]
    messages = sorted(chain(*both), key=lambda message: message.log_time_ns)
    found, there, _ = seen(write_messages(tmp_path / "a.mcap", messages))
    rigs = [one.rig for one in found.rigs]
    kept = {(rig.topic(1), rig.cameras[0].focal_px): numbers(items) for rig, items in zip(rigs, there, strict=True)}
    assert len(kept) == 3
    assert kept["/rear1/image_rect", 50.0] == [*range(10)]
    assert [*kept.values()].count([*range(5)]) == 1
    assert [*kept.values()].count([*range(5, 10)]) == 1


def _behind(rear: Rig, turned: np.ndarray, first: int) -> list[Message]:
    """The messages of cameras that look backwards."""
    messages = messages_of(".mcap", rear, frames(range(first, first + 5), rear))
    children = {f"rear{camera.number}": turned @ motion(np.eye(3), camera.centre_m) for camera in rear.cameras}
    data = MAKER.transforms("rig", children, messages[0].log_time_ns)
    return [replace(m, data=data) if m.schema == schemas.TRANSFORMS else m for m in messages]

"""Every container with every form of images: the frames that went in come out, and every message is accounted for."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.writer import Writer

from auditor.errors import DecodingError
from auditor.recordings import open_recording, survey, write_mcap
from auditor.recordings.decoding.pictures import check_received, encode_picture, grey_if_grey
from auditor.recordings.writers.messages import Form, MessageMaker
from tests.making.forms import CONTAINERS, Container
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = {False: make_frames(RIG, 4), True: make_frames(RIG, 4, colour=True)}


PICTURES: tuple[tuple[Form, bool], ...] = (("raw", False), ("raw", True), ("png", True), ("jpeg", False))
IN_TURN = [(container, *PICTURES[place % len(PICTURES)]) for place, container in enumerate(CONTAINERS)]
"""Containers hold bytes, whatever these are of: each has one form of pictures, and each form has several containers."""


@pytest.mark.parametrize(("container", "form", "colour"), IN_TURN, ids=lambda one: getattr(one, "name", str(one)))
def test_a_recording_gives_the_frames_that_were_written(
    container: Container, form: Form, colour: bool, tmp_path: Path
) -> None:
    written = FRAMES[colour]
    with open_recording(container.write(tmp_path, RIG, written, form)) as recording:
        stream = stream_of(recording, colour=colour)
        frames, skipped = split(stream)
        assert recording.damage == ()
        assert all(topic.adds_up for topic in stream.balance)
        assert [topic.read for topic in stream.balance if topic.sensor is not None] == [4] * 4
    assert not skipped
    assert len(frames) == 4
    if form != "jpeg":
        assert all(same_frame(a, b) for a, b in zip(frames, written, strict=True))
        return
    for frame, before in zip(frames, written, strict=True):
        assert np.array_equal(frame.cloud.xyz_m, before.cloud.xyz_m)
        for number, image in frame.images.items():
            packed = np.frombuffer(encode_picture(before.images[number].pixels, "jpeg"), np.uint8)
            assert np.array_equal(image.pixels, cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize(("apart", "grey"), [(0, True), (7, True), (8, False)])
def test_a_grey_picture_of_three_channels_is_grey(apart: int, grey: bool) -> None:
    """As grey cameras are recorded in bgr8, WebP and videos; lossy codecs round the channels a little."""
    levels = np.random.default_rng(1).integers(0, 240, (48, 64), np.uint8)
    pixels = np.stack([levels] * 3, axis=-1)
    pixels[7, 9, 0] += apart
    found = grey_if_grey(pixels)
    assert found.ndim == (2 if grey else 3)
    assert np.array_equal(found, pixels) if not grey else np.abs(found.astype(int) - levels).max() <= 1


@pytest.mark.parametrize(
    ("tint", "coloured", "grey"),
    [((3, -4), 0, True), ((13, 0), 0, True), ((14, 0), 0, False), ((3, -4), 8, False)],
    ids=["of a converter", "a strong one", "a stronger one", "a pixel of a colour beside"],
)
def test_a_grey_picture_with_the_same_tint_all_over_is_grey(tint: tuple[int, int], coloured: int, grey: bool) -> None:
    """A converter to video whose middle of chroma is off by one leaves a tint of three levels; black has none."""
    levels = np.random.default_rng(1).integers(0, 256, (48, 64), np.uint8)
    pixels = np.stack([(levels + np.int16(more)).clip(0, 255) for more in (tint[0], 0, tint[1])], axis=-1)
    levels[7, 9], pixels[7, 9] = 100, 100 + np.array([tint[0] + coloured, 0, tint[1]])
    assert grey_if_grey(pixels.astype(np.uint8)).ndim == (2 if grey else 3)


@pytest.mark.parametrize("chroma", [127, 129])
def test_a_grey_video_whose_chroma_was_rounded_here_and_there_is_grey(chroma: int) -> None:
    """Converters of grey to video leave a middle of 127, and codecs put it right in some blocks of some pictures."""
    planes = np.full((72, 64), chroma, np.uint8)
    planes[:48] = np.random.default_rng(1).integers(16, 236, (48, 64), np.uint8)
    for other in (chroma, 128, 2 * 128 - chroma):
        planes[48:50] = other
        assert grey_if_grey(np.asarray(cv2.cvtColor(planes, cv2.COLOR_YUV2BGR_I420), np.uint8)).ndim == 2


def test_a_grey_camera_gives_the_same_frames_in_three_channels(tmp_path: Path) -> None:
    plain = FRAMES[False]
    tripled = [
        replace(frame, images={n: replace(i, pixels=np.stack([i.pixels] * 3, -1)) for n, i in frame.images.items()})
        for frame in plain
    ]
    write_mcap(tmp_path / "tripled.mcap", RIG, tripled)
    with open_recording(tmp_path / "tripled.mcap") as recording:
        frames, _ = split(stream_of(recording, colour=True))
    assert all(same_frame(a, b) for a, b in zip(frames, plain, strict=True))


def filled(rows: int, level: int) -> np.ndarray:
    pixels = np.random.default_rng(2).integers(0, 255, (48, 64), np.uint8)
    pixels[48 - rows :] = level
    return pixels


@pytest.mark.parametrize(("rows", "level", "says"), [(48, 0, "shows nothing"), (24, 128, "last 24 rows were never")])
def test_a_picture_that_no_sensor_gives_is_damaged(rows: int, level: int, says: str) -> None:
    for pixels in (filled(rows, level), np.stack([filled(rows, level)] * 3, axis=-1)):
        with pytest.raises(DecodingError, match=says):
            check_received(pixels)


def test_why_messages_of_a_camera_do_not_decode_is_said(tmp_path: Path) -> None:
    blank = [
        replace(
            frame, images={n: replace(i, pixels=np.full_like(i.pixels, 7 * (n == 1))) for n, i in frame.images.items()}
        )
        for frame in FRAMES[False]
    ]
    write_mcap(tmp_path / "blank.mcap", RIG, blank)
    with open_recording(tmp_path / "blank.mcap") as recording:
        stream = stream_of(recording)
        list(stream)
        said = stream.undecoded
    assert [one.partition(": ")[0] for one in said] == [camera.name for camera in RIG.cameras]
    assert all(f"{len(blank)} messages from 0.0 s on: it shows nothing" in one for one in said)


@pytest.mark.parametrize(("rows", "level"), [(48, 255), (24, 255), (6, 0), (3, 128), (0, 0)])
def test_light_everywhere_bars_and_a_few_rows_are_no_damage(rows: int, level: int) -> None:
    check_received(filled(rows, level))


@pytest.mark.parametrize(
    ("frames", "shared"),
    [
        (("left", "right", "left"), True),
        (("left", "left", "right", "right"), False),
        (("left", "1", "2"), False),
        (("left", "", "left"), False),
    ],
)
def test_cameras_that_take_turns_in_one_topic_cannot_be_read(
    tmp_path: Path, frames: tuple[str, ...], shared: bool
) -> None:
    maker = MessageMaker("cdr")
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channel = writer.register_channel("/a", "cdr", writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b""))
        for time_ns, frame in enumerate(frames, start=1):
            data = maker.raw_image(np.zeros((4, 4), np.uint8), "mono8", maker.header(time_ns, frame))
            writer.add_message(channel, time_ns, data, time_ns)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        known = survey(recording)
    [problem] = known.problems
    assert "/a: its messages are of several coordinate frames" in problem
    assert len(known.images) == (not shared)
    reasons = [one.reason for one in known.unreadable]
    assert reasons == ["the messages of several sensors take turns in it, in the frames left and right"] * shared

"""Cameras of 10 to 16 bits are measured as those of 8 whose values are their upper bits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import CameraImage, Frame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, given_rig, open_recording, read_rig, survey, synchronise, write_rig
from tests.making.scenes import plane_rig
from tests.making.sensor_forms import Sensor, Values, write_sensors
from tests.making.small_drives import drive_frames

RIG = plane_rig()
FRAMES = 3


def deep(bits: int, *, left: bool = False):
    """Values of so many bits whose upper 8 are the pixels; aligned to the left end of 16 where asked."""

    def of(pixels):
        noise = np.random.default_rng(1).integers(0, 1 << (bits - 8), pixels.shape)
        values = ((pixels.astype(np.uint16) << (bits - 8)) + noise).astype(np.uint16)
        return values << (16 - bits) if left else values

    return of


def read(path: Path, rig: Rig | None = None) -> tuple[Rig, list[Frame]]:
    with open_recording(path) as recording:
        surveyed = survey(recording)
        known = rig or find_rigs(surveyed)[0]
        return known, [item for item in synchronise(recording, known, surveyed) if isinstance(item, Frame)]


@pytest.mark.parametrize(
    ("values", "bits"),
    [
        (Values("mono16", deep(10)), 10),
        (Values("mono16", deep(12)), 12),
        (Values("mono16", deep(12, left=True)), 16),
        (Values("16UC1", deep(14), big_endian=True), 14),
        (Values("mono16", deep(16)), 16),
        (Values("png", deep(12)), 12),
        (Values("png", deep(12, left=True)), 16),
    ],
)
def test_the_counts_are_those_of_the_upper_8_bits(tmp_path: Path, values: Values, bits: int) -> None:
    frames = list(drive_frames(RIG, FRAMES))
    usual_rig, usual = read(write_sensors(tmp_path / "usual.mcap", RIG, frames))
    rig, found = read(write_sensors(tmp_path / "deep.mcap", RIG, frames, values=values))
    assert [camera.depth_bits for camera in usual_rig.cameras] == [None] * 3
    assert [camera.depth_bits for camera in rig.cameras] == [bits] * 3
    assert len(found) == len(usual) == FRAMES
    for one, other in zip(found, usual, strict=True):
        for sensor in one.images:
            np.testing.assert_array_equal(one.images[sensor].pixels, other.images[sensor].pixels)
    matcher = SgbmMatcher()
    assert measure(found[0], rig, matcher)[0].counts == measure(usual[0], usual_rig, matcher)[0].counts


@pytest.mark.parametrize("order", ["rggb", "grbg"])
def test_a_mosaic_of_12_bits_is_that_of_8(tmp_path: Path, order: str) -> None:
    frames = list(drive_frames(RIG, FRAMES))
    _, usual = read(write_sensors(tmp_path / "usual.mcap", RIG, frames, values=Values(f"bayer_{order}8")))
    _, found = read(write_sensors(tmp_path / "deep.mcap", RIG, frames, values=Values(f"bayer_{order}16", deep(12))))
    np.testing.assert_array_equal(found[0].images[1].pixels, usual[0].images[1].pixels)


def test_the_scale_is_that_of_the_first_pictures_and_what_lies_above_it_is_saturated(tmp_path: Path) -> None:
    frames = list(drive_frames(RIG, 14))
    last = frames[-1].images

    def of(pixels):
        dazzled = any(np.array_equal(pixels, image.pixels) for image in last.values())
        values = deep(12)(pixels)
        values[:, :10] = 65_535 if dazzled else values[:, :10]
        return values

    rig, found = read(write_sensors(tmp_path / "deep.mcap", RIG, frames, values=Values("mono16", of)))
    assert rig.camera(1).depth_bits == 12
    assert (found[-1].images[1].pixels[:, :10] == 255).all()
    np.testing.assert_array_equal(found[-1].images[1].pixels[:, 10:], last[1].pixels[:, 10:])


def test_a_dark_camera_has_the_scale_of_those_that_it_is_compared_with(tmp_path: Path) -> None:
    frames = [
        replace(
            frame, images={n: CameraImage(n, i.stamp_ns, i.pixels // (4 if n == 1 else 1)) for n, i in images.items()}
        )
        for frame in drive_frames(RIG, FRAMES)
        for images in [frame.images]
    ]
    rig, found = read(write_sensors(tmp_path / "deep.mcap", RIG, frames, values=Values("mono16", deep(12))))
    assert [camera.depth_bits for camera in rig.cameras] == [12] * 3
    np.testing.assert_array_equal(found[0].images[1].pixels, frames[0].images[1].pixels)


def test_a_rig_file_keeps_the_depth_and_one_without_it_takes_the_recording_s(tmp_path: Path) -> None:
    path = write_sensors(tmp_path / "a.mcap", RIG, drive_frames(RIG, FRAMES), values=Values("mono16", deep(12)))
    rig, _ = read(path)
    write_rig(rig, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml").rig_id == rig.rig_id
    text = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(text.replace("depth_bits = 12\n", ""))
    with open_recording(path) as recording:
        assert given_rig(tmp_path / "rig.toml", survey(recording)).camera(1).depth_bits == 12
    (tmp_path / "rig.toml").write_text(text.replace("depth_bits = 12\n", "depth_bits = 40\n"))
    assert run(["inspect", str(path), "--rig", str(tmp_path / "rig.toml")]) == 2


def test_an_attacked_copy_keeps_the_scale(tmp_path: Path) -> None:
    frames = list(drive_frames(RIG, FRAMES))
    path = write_sensors(tmp_path / "a.mcap", RIG, frames, Sensor(), Values("mono16", deep(12)))
    assert run(["attack", str(path), str(tmp_path / "b.mcap"), "--on", "S_2", "--size", "5"]) == 0
    _, found = read(tmp_path / "b.mcap")
    assert np.mean(found[0].images[2].pixels == frames[0].images[2].pixels) > 0.5

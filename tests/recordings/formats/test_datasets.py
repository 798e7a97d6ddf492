"""Drives of published data sets, written as their documents say, and a real one."""

import json
import struct
import tracemalloc
import zipfile
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.feather
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import RecordingError
from auditor.measurement import measure
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher
from auditor.model.frames import SensorState
from auditor.model.measurement import Statistic
from auditor.model.optics.geometry import compose, motion
from auditor.recordings import find_recordings, find_rigs, open_recording, survey, synchronise
from auditor.recordings.formats.datasets.argoverse import table_of
from auditor.recordings.formats.datasets.dgp import points_of_npz
from auditor.recordings.writers.convert import convert
from tests.making.datasets import (
    WriteFolder,
    write_argoverse,
    write_dgp,
    write_kitti_360,
    write_nuscenes,
    write_pandaset,
)
from tests.making.forms import CONTAINERS
from tests.making.message_forms import drive
from tests.making.reading_all import frames_of
from tests.making.scenes import plane_rig

RIG = plane_rig((0.6, 0.3, 0.0))
FRAMES = drive(RIG, 2)
LOSSLESS: dict[str, WriteFolder] = {"dgp": write_dgp, "nuscenes": write_nuscenes}
WRITERS: dict[str, WriteFolder] = {**LOSSLESS, "argoverse": write_argoverse, "pandaset": write_pandaset}


def measured(path: Path):
    """The frames, every E of them, and the points of each in the frame of S_1; all is accounted for."""
    rig, frames, _ = frames_of(path)
    matcher = find_matcher("sgbm", MatcherOptions())
    counts = [measure(frame, rig, matcher)[0].counts for frame in frames]
    E = [[c.disparity_error(s) for c in of_frame for s in Statistic if c] for of_frame in counts]
    camera = rig.camera(1)
    place = compose(motion(camera.rotation, -camera.rotation @ camera.centre_m), rig.lidar.rig_SE3_lidar)
    return frames, E, [frame.cloud.xyz_m @ place[:3, :3].T + place[:3, 3] for frame in frames]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory):
    container = next(container for container in CONTAINERS if container.name == "mcap ros2")
    return measured(container.write(tmp_path_factory.mktemp("plain"), RIG, FRAMES, "raw"))


@pytest.mark.parametrize("name", WRITERS)
def test_a_drive_gives_its_frames_and_counts(tmp_path: Path, name: str, plain) -> None:
    frames, E, points_m = measured(WRITERS[name](tmp_path / "drive", RIG, FRAMES))
    assert all(np.abs(a - b).max() < 1e-4 for a, b in zip(points_m, plain[2], strict=True))
    assert [frame.stamp_ns for frame in frames] == [frame.stamp_ns for frame in plain[0]]
    for frame, other in zip(frames, plain[0], strict=True):
        assert all(there.state is SensorState.PRESENT for there in frame.presence.values())
        for number, image in frame.images.items():
            off = np.abs(image.pixels.astype(int) - other.images[number].pixels)
            assert off.max() == 0 if name in LOSSLESS else off.mean() < 2
    off = max(abs(a - b) for one, other in zip(E, plain[1], strict=True) for a, b in zip(one, other, strict=True))
    print(f"{name}: E off by at most {off:.4f}")
    assert off == 0 if name in LOSSLESS else off <= 0.04


def test_a_drive_of_kitti_360_gives_its_frames(tmp_path: Path) -> None:
    path = write_kitti_360(tmp_path, RIG, FRAMES)
    with open_recording(path) as recording:
        known = survey(recording)
        [rig] = find_rigs(known)
        frames = list(synchronise(recording, rig, known))
    assert (rig.n, rig.lidar is not None) == (2, True)
    for frame, written in zip(frames, FRAMES, strict=True):
        assert frame.stamp_ns == written.stamp_ns
        for ours, theirs in ((2, 3), (1, 2)):
            pixels = written.images[theirs].pixels
            assert np.abs(frame.images[ours].pixels.astype(int) - np.dot(pixels, [0.114, 0.587, 0.299])).max() <= 1
        points = (a.cloud.xyz_m for a in (frame, written))
        assert np.array_equal(*points)
    expected, read = (
        RIG.camera(3).projection @ RIG.lidar.rig_SE3_lidar,
        rig.camera(2).projection @ rig.lidar.rig_SE3_lidar,
    )
    assert np.allclose(expected, read, atol=1e-6)


@pytest.mark.parametrize("name", WRITERS)
def test_a_drive_is_found_in_a_folder_above_and_becomes_mcap(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / "above" / "drive", RIG, FRAMES)
    [found] = find_recordings([tmp_path / "above"]).recordings
    with open_recording(found) as recording:
        kept = recording.recording_id
        report = convert(recording, tmp_path / "a.mcap")
    assert not report.left_out
    assert sum(report.messages.values()) == 1 + 3 + 4 * len(FRAMES)
    with open_recording(tmp_path / "a.mcap") as recording:
        assert recording.metadata()["source"] == kept


@pytest.mark.parametrize("name", LOSSLESS)
def test_files_that_are_named_and_not_there_are_damage(tmp_path: Path, name: str) -> None:
    path = LOSSLESS[name](tmp_path / "drive", RIG, FRAMES)
    next(path.rglob("*.png")).unlink()
    with open_recording(path) as recording:
        messages = list(recording.messages())
        assert [damage.what for damage in recording.damage] == ["1 of the files that it names are not there"]
    assert len(messages) == 1 + 3 + 4 * len(FRAMES) - 1


def test_names_that_lead_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    path = write_dgp(tmp_path / "drive", RIG, FRAMES)
    (tmp_path / "outside.png").write_bytes(b"secret")
    scene = next(path.glob("scene_*.json"))
    described = json.loads(scene.read_text())
    for number, name in enumerate(("../outside.png", str(tmp_path / "outside.png"))):
        described["data"][number]["datum"]["image"]["filename"] = name
    scene.write_text(json.dumps(described))
    with open_recording(path) as recording:
        assert not any(b"secret" in bytes(message.data) for message in recording.messages())
        assert tmp_path / "outside.png" not in recording.files


def test_a_damaged_cloud_is_a_damaged_message(tmp_path: Path) -> None:
    path = write_dgp(tmp_path / "drive", RIG, FRAMES)
    next(path.rglob("*.npz")).write_bytes(b"PK")
    with open_recording(path) as recording:
        assert sum(not message.data for message in recording.messages()) == 1
        assert "its points cannot be read" in str(recording.damage[0])


def test_several_scenes_of_nuscenes_are_said_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"2 scenes.*nuscenes_scene\.py"):
        open_recording(write_nuscenes(tmp_path, RIG, FRAMES, scenes=2))


def test_the_recipe_makes_a_folder_of_one_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = Path(__file__).resolve().parents[3] / "recipes" / "nuscenes_scene.py"
    described = spec_from_file_location("nuscenes_scene", recipe)
    assert described
    assert described.loader
    module = module_from_spec(described)
    described.loader.exec_module(module)
    write_nuscenes(tmp_path / "all", RIG, FRAMES, scenes=2)
    module.main(tmp_path / "all", "scene-1", tmp_path / "one")
    assert "4 of 4 files" in capsys.readouterr().out
    with open_recording(tmp_path / "one") as recording:
        assert sum(message.topic.endswith(("image", "points")) for message in recording.messages()) == 4


def npz(array: np.ndarray) -> bytes:
    packed = BytesIO()
    np.savez_compressed(packed, data=array)
    return packed.getvalue()


WIDE = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776, 4)}"


def npz_of(member: bytes) -> bytes:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("data.npy", member)
    return packed.getvalue()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        npz(np.zeros((5, 3))),
        npz(np.zeros(5)),
        npz(np.zeros((5, 4), np.int64)),
        npz(np.array([{"a": 1}], dtype=object)),
        npz_of(
            b"\x93NUMPY\x01\x00"
            + struct.pack("<H", 80)
            + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1099511627776, 4)}".ljust(80)
        ),
        npz_of(bytes(200)),
    ],
)
def test_arrays_that_are_no_clouds_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r".+"):
        points_of_npz(data)


def test_an_array_that_unpacks_to_much_is_refused() -> None:
    with pytest.raises(ValueError, match=r".+"):
        points_of_npz(npz_of(bytes(200_000_000)))


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_table_that_would_unpack_to_too_much_is_refused_before(compression: str) -> None:
    out = BytesIO()
    values = np.zeros(40_000_000, np.uint8)
    table = pyarrow.table(dict.fromkeys(("x", "y", "z", "intensity"), values))
    pyarrow.feather.write_feather(table, out, compression=compression, chunksize=10_000_000)
    tracemalloc.start()
    with pytest.raises(ValueError, match="unpack"):
        table_of(out.getvalue())
    assert tracemalloc.get_traced_memory()[1] < 2 * 10**6
    tracemalloc.stop()


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.data())
def test_noise_in_files_of_clouds_raises_one_kind_of_error(data: st.DataObject) -> None:
    points = np.random.default_rng(1).normal(0, 9, (40, 4)).astype(np.float32)
    whole = bytearray(npz(points) if data.draw(st.booleans()) else FEATHER)
    read = points_of_npz if whole[:2] == b"PK" else table_of
    for _ in range(data.draw(st.integers(1, 5))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    with suppress(ValueError):
        read(bytes(whole))


def _feather() -> bytes:
    out = BytesIO()
    values = np.arange(40, dtype=np.float32)
    pyarrow.feather.write_feather(pyarrow.table({"x": values, "y": values, "z": values, "intensity": values}), out)
    return out.getvalue()


FEATHER = _feather()


def test_a_real_scene_of_ddad_is_read(real_data: Path) -> None:
    with open_recording(real_data / "ddad_scene_01") as recording:
        known = survey(recording)
        assert [image.size_px for image in known.images] == [(1936, 1216)] * 3
        assert known.clouds[0].points > 40_000
        rigs = find_rigs(known)
        assert all(rig.lidar for rig in rigs)
        frames = list(synchronise(recording, rigs[0], known))
        assert recording.damage == ()
    assert len(frames) == 3
    assert [round((b.stamp_ns - a.stamp_ns) / 1e6) for a, b in pairwise(frames)] == [100, 100]
    xyz_m = frames[0].cloud.xyz_m
    camera = rigs[0].camera(1)
    seen = np.hstack([xyz_m, np.ones((len(xyz_m), 1))]) @ (camera.projection @ rigs[0].lidar.rig_SE3_lidar).T
    u, v = (seen[:, :2] / seen[:, 2:]).T
    inside = (seen[:, 2] > 1) & (u > 0) & (u < 1936) & (v > 0) & (v < 1216)
    assert inside.sum() > 1000

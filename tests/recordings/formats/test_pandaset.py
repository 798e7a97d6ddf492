"""Sequences of PandaSet: their pickled clouds are read without anything of a pickle being run."""

import gzip
import json
import os
import pickle
import struct
import tracemalloc
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import RecordingError
from auditor.recordings import find_rigs, open_recording, survey
from auditor.recordings.formats.datasets.pandaset import points_of_pickle
from auditor.recordings.formats.datasets.pickles import columns_of
from tests.making.datasets import write_pandaset
from tests.making.message_forms import drive
from tests.making.pickled_tables import LAYOUTS, pickled
from tests.making.scenes import plane_rig

RIG = plane_rig((0.6, 0.3, 0.0))
FRAMES = drive(RIG, 3)
PLAIN = LAYOUTS["1.5.3, protocol 4"]


@pytest.mark.parametrize("version", LAYOUTS)
def test_a_table_of_any_version_of_pandas_gives_its_columns(version: str) -> None:
    order = [0, 1, 3, 2] if version.endswith("joined") else [0, 1, 2, 3]
    columns = columns_of(LAYOUTS[version], ("x", "y", "z", "i", "d"))
    expected = {"x": [0.5, 1.5, 2.5, 3.5], "y": [0, 2, 4, 6], "z": [-1, 0, 1, 2], "i": [0, 10, 20, 30]}
    expected |= {"d": [0, 0, 1, 0]}
    assert {name: column.tolist() for name, column in columns.items()} == {
        name: [values[row] for row in order] for name, values in expected.items()
    }


@pytest.mark.parametrize("packed", [False, True])
def test_points_of_the_other_lidar_are_left_out(*, packed: bool) -> None:
    points = points_of_pickle(gzip.compress(PLAIN) if packed else PLAIN)
    assert points.tolist() == [[0.5, 0, -1, 0], [1.5, 2, 0, 10], [3.5, 6, 2, 30]]


def test_columns_in_other_orders_and_kinds_give_the_same_points() -> None:
    x, y, z = np.random.default_rng(1).normal(0, 9, (3, 20))
    columns = {"d": np.zeros(20, np.int64), "z": z.astype(">f4"), "y": y, "i": np.arange(20, dtype=np.uint8), "x": x}
    for protocol in (2, 4, 5):
        points = points_of_pickle(pickled(columns, protocol))
        assert np.array_equal(points, np.column_stack([x, y, z.astype(np.float32), np.arange(20)]))


def test_a_camera_that_is_taken_at_another_time_is_placed_by_the_way_between(tmp_path: Path) -> None:
    late = 40_000_000
    frames = [
        replace(f, images=f.images | {2: replace(f.images[2], stamp_ns=f.images[2].stamp_ns - late)}) for f in FRAMES
    ]
    with open_recording(write_pandaset(tmp_path / "001", RIG, frames)) as recording:
        [rig] = find_rigs(survey(recording))
    [camera] = [camera for camera in rig.cameras if camera.name == "left_camera_2"]
    [front] = [camera for camera in rig.cameras if camera.name == "front_camera"]
    expected = np.linalg.norm(RIG.camera(2).centre_m - RIG.camera(1).centre_m)
    assert abs(np.linalg.norm(camera.centre_m - front.centre_m) - expected) < 2e-3


def test_a_sequence_without_its_front_camera_is_said(tmp_path: Path) -> None:
    path = write_pandaset(tmp_path / "001", RIG, FRAMES)
    (path / "camera" / "front_camera").rename(path / "camera" / "other_camera")
    with pytest.raises(RecordingError, match="no front_camera"):
        open_recording(path)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("poses.json", [{"position": {"x": 0, "y": 0, "z": 0}, "heading": {"w": 0, "x": 0, "y": 0, "z": 0}}] * 3),
        ("poses.json", []),
        ("timestamps.json", [2.0, 1.0, 3.0]),
        ("timestamps.json", [1.0, 2.0, 1e300]),
        ("intrinsics.json", {"fx": 1}),
        ("intrinsics.json", [1]),
    ],
)
def test_an_ill_formed_description_is_said(tmp_path: Path, file: str, content: object) -> None:
    path = write_pandaset(tmp_path / "001", RIG, FRAMES)
    (path / "camera" / "front_camera" / file).write_text(json.dumps(content))
    with pytest.raises(RecordingError, match="ill-formed"):
        open_recording(path)


def test_pictures_and_clouds_that_are_not_there_are_damage(tmp_path: Path) -> None:
    path = write_pandaset(tmp_path / "001", RIG, FRAMES)
    (path / "lidar" / "01.pkl.gz").unlink()
    (path / "camera" / "left_camera_2" / "00.jpg").unlink()
    with open_recording(path) as recording:
        assert len([message for message in recording.messages() if message.topic.endswith("points")]) == 2
        assert [damage.what for damage in recording.damage] == ["2 of the files that it names are not there"]


class Runs:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (os.system, (f"touch {self.path}",))


def test_a_pickle_that_would_run_a_program_is_a_damaged_message(tmp_path: Path) -> None:
    path = write_pandaset(tmp_path / "001", RIG, FRAMES)
    (path / "lidar" / "01.pkl.gz").write_bytes(gzip.compress(pickle.dumps(Runs(tmp_path / "ran"))))
    with open_recording(path) as recording:
        assert sum(not message.data for message in recording.messages()) == 1
        assert "names 'posix.system', which is no part of a table" in recording.damage[0].what
    assert not (tmp_path / "ran").exists()


def with_shape(rows: bytes) -> bytes:
    """The table, whose first array declares another number of rows."""
    assert PLAIN.count(b"K\x05K\x04\x86") == 1
    return PLAIN.replace(b"K\x05K\x04\x86", b"K\x05" + rows + b"\x86")


def keys_of_keys(depth: int) -> bytes:
    """A dict whose key is a tuple of the same tuple twice, so deep: its hash would take 2^depth steps."""
    nested = b"".join(b"h" + bytes([n]) + b"h" + bytes([n]) + b"\x86\x94" for n in range(depth))
    return b"\x80\x04})\x94" + nested + b"Ns."


HOSTILE = {
    "nothing": b"",
    "cut": PLAIN[:-40],
    "no table": pickle.dumps({"x": [1.0]}),
    "a method of a known name": b"\x80\x04\x8c\x05numpy\x8c\x0dndarray.dumps\x93.",
    "calls what it called": b"\x80\x04cnumpy\ndtype\n)R)R.",
    "text that is run": b"\x80\x04cbuiltins\neval\n\x8c\x011\x85R.",
    "persistent": b"\x80\x04\x8c\x01aQ.",
    "an extension": b"\x80\x02\x82\x01.",
    "a buffer from elsewhere": b"\x80\x05\x97.",
    "a far place of the memo": b"\x80\x04Nr\xff\xff\xff\x7f.",
    "long bytes": b"\x80\x04\x8e" + struct.pack("<Q", 1 << 62) + b"a.",
    "long array of bytes": b"\x80\x05\x96" + struct.pack("<Q", 1 << 62) + b"a.",
    "long frame": b"\x80\x04\x95" + struct.pack("<Q", 1 << 62) + b"N.",
    "deep": b"\x80\x04" + b"(" * 5_000 + b"t" * 4_999 + b".",
    "many steps": b"\x80\x04]" + b"Na" * 2_000_000 + b".",
    "keys of keys": keys_of_keys(200),
    "more rows than there are": with_shape(b"M\xff\xff"),
    "rows without end": with_shape(b"\x8a\x08" + struct.pack("<q", (1 << 62) - 1)),
    "rows below none": with_shape(b"J\xff\xff\xff\xff"),
    "packed without end": gzip.compress(bytes(200_000_000), 1),
    "packed and cut": gzip.compress(PLAIN)[:-20],
    "packed twice": gzip.compress(PLAIN) * 2,
    "packed and understated": gzip.compress(PLAIN)[:-4] + struct.pack("<I", 9),
    "packed and overstated": gzip.compress(PLAIN)[:-4] + struct.pack("<I", 1 << 25),
    "no x": pickled({"y": np.zeros(3), "z": np.zeros(3), "i": np.zeros(3)}),
    "objects": pickled({name: np.array([{}], object) for name in "xyz"}),
    "complex": pickled({name: np.zeros(3, complex) for name in "xyz"}),
    "strings of pandas 3": b"\x80\x04cpandas.arrays\nArrowStringArray\n.",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_pickle_is_refused_and_costs_little(name: str) -> None:
    data = HOSTILE[name]
    tracemalloc.start()
    with pytest.raises(ValueError, match=r".+"):
        points_of_pickle(data)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < len(data) + 4 * 10**6


def test_rows_beyond_those_of_a_sweep_are_refused_before_they_are_laid_out() -> None:
    data = pickled({name: np.zeros(3 << 20, np.int8) for name in "xyz"})
    tracemalloc.start()
    with pytest.raises(ValueError, match="3145728 rows"):
        points_of_pickle(data)
    assert tracemalloc.get_traced_memory()[1] < 2 * len(data)
    tracemalloc.stop()


def test_numbers_that_are_no_distances_give_no_warning(tmp_path: Path) -> None:
    path = write_pandaset(tmp_path / "001", RIG, FRAMES)
    none = np.array([0x7F800001], "<u4").view("<f4")  # a NaN that signals
    far = {name: np.array([1e300, np.nan, np.inf, 5.0]) for name in "xy"} | {"z": np.tile(none, 4)}
    (path / "lidar" / "01.pkl.gz").write_bytes(gzip.compress(pickled(far)))
    with open_recording(path) as recording:
        assert all(message.data for message in recording.messages())


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.data())
def test_noise_in_a_pickle_raises_one_kind_of_error(data: st.DataObject) -> None:
    whole = bytearray(LAYOUTS[data.draw(st.sampled_from(sorted(LAYOUTS)))])
    for _ in range(data.draw(st.integers(1, 5))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    with suppress(ValueError):
        points_of_pickle(bytes(whole))

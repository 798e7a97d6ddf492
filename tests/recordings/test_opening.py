import gzip
import os
import shutil
import socket
import sqlite3
import tarfile
import zipfile
from contextlib import closing
from pathlib import Path

import pytest

from auditor.errors import RecordingError
from auditor.recordings import Location, find_recordings, format_of, open_recording, write_bag, write_db3, write_mcap
from auditor.recordings import opening as opening_of_paths
from auditor.recordings.content import FileContent, open_regular
from tests.making.recorded_drives import make_frames, make_rig

RIG = make_rig(2)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    frames = make_frames(RIG, 2)
    write_mcap(folder / "b" / "two.mcap", RIG, frames)
    write_mcap(folder / "b" / "one.MCAP", RIG, frames)
    write_bag(folder / "a" / "deep" / "three.bag", RIG, frames)
    write_db3(folder / "c", RIG, frames)
    (folder / "notes.txt").write_text("not a recording")
    (folder / ".hidden").mkdir()
    shutil.copy(folder / "b" / "two.mcap", folder / ".hidden" / "x.mcap")
    return folder


def names(paths: tuple[Location, ...]) -> list[str]:
    return [path.name for path in paths]


def test_files_and_folders_give_their_recordings_each_once_in_order(fleet: Path) -> None:
    assert names(find_recordings([fleet]).recordings) == ["three.bag", "one.MCAP", "two.mcap", "c"]
    found = find_recordings([fleet / "b" / "two.mcap", fleet / "b", fleet / "c" / "c.db3", fleet / "b" / "two.mcap"])
    assert names(found.recordings) == ["two.mcap", "one.MCAP", "c.db3"]
    assert not found.errors


def test_a_rosbag2_folder_without_its_metadata_is_a_recording(fleet: Path, tmp_path: Path) -> None:
    shutil.copytree(fleet / "c", tmp_path / "c")
    (tmp_path / "c" / "metadata.yaml").unlink()
    assert names(find_recordings([tmp_path]).recordings) == ["c"]
    with open_recording(tmp_path / "c") as recording:
        assert len(list(recording.messages())) == 1 + 2 * 5 + 1


def test_a_db3_file_in_a_folder_hides_no_other_recording(fleet: Path, tmp_path: Path) -> None:
    night = tmp_path / "night"
    shutil.copytree(fleet / "b", night)
    shutil.copy(fleet / "c" / "c.db3", night / "c.db3")
    shutil.copytree(fleet / "a", night / "deeper")
    (night / "empty.db3").touch()
    (night / "damaged.db3").write_bytes(bytes(5000))
    found = find_recordings([night])
    assert names(found.recordings) == ["c.db3", "damaged.db3", "three.bag", "empty.db3", "one.MCAP", "two.mcap"]
    assert names(find_recordings([tmp_path]).recordings) == names(found.recordings)
    with pytest.raises(RecordingError, match="it holds 6 recordings"):
        open_recording(night)
    with pytest.raises(RecordingError, match="is empty"):
        open_recording(night / "empty.db3")


def test_db3_files_are_one_recording_only_where_their_names_are_those_of_parts(fleet: Path, tmp_path: Path) -> None:
    for name in ("monday.db3", "tuesday.db3"):
        shutil.copy(fleet / "c" / "c.db3", tmp_path / name)
    assert names(find_recordings([tmp_path]).recordings) == ["monday.db3", "tuesday.db3"]


@pytest.mark.parametrize("listed", ["", "  relative_file_paths:\n  - c.db3\n"])
def test_what_lies_in_a_rosbag2_folder_and_is_no_part_of_it_is_a_recording_too(
    fleet: Path, tmp_path: Path, listed: str
) -> None:
    bag = tmp_path / "night" / "c"
    shutil.copytree(fleet / "c", bag)
    shutil.copytree(fleet / "a", bag / "deeper")
    shutil.copy(fleet / "b" / "two.mcap", bag / "b.mcap")
    shutil.copy(fleet / "a" / "deep" / "three.bag", bag / "a.bag")
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n" + listed)
    for given in (bag, tmp_path / "night", tmp_path):
        assert names(find_recordings([given]).recordings) == ["c", "a.bag", "b.mcap", "three.bag"]
    with open_recording(bag) as recording:
        assert [file.name for file in recording.files] == ["c.db3"]


def test_the_files_of_a_rosbag2_folder_are_those_that_its_metadata_list(fleet: Path, tmp_path: Path) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "drive_0.mcap")
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "drive_1.mcap")
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "other.mcap")
    shutil.copy(fleet / "c" / "c.db3", tmp_path / "c.db3")
    (tmp_path / "metadata.yaml").write_text("  relative_file_paths:\n  - drive_0.mcap\n")
    assert names(find_recordings([tmp_path]).recordings) == [tmp_path.name, "c.db3", "other.mcap"]
    with open_recording(tmp_path) as recording:
        assert [file.name for file in recording.files] == ["drive_0.mcap", "drive_1.mcap"]


def test_a_recording_in_the_folder_of_a_dataset_s_drive_is_one_too(fleet: Path, tmp_path: Path) -> None:
    (tmp_path / "drive" / "image_00" / "data").mkdir(parents=True)
    shutil.copy(fleet / "c" / "c.db3", tmp_path / "drive" / "c.db3")
    assert names(find_recordings([tmp_path]).recordings) == ["drive", "c.db3"]


def test_each_path_without_a_recording_gives_an_error_and_the_others_are_found(fleet: Path, tmp_path: Path) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "nothing").mkdir()
    wrong = [tmp_path / "missing.mcap", tmp_path / "empty.mcap", tmp_path / "nothing", fleet / "notes.txt"]
    found = find_recordings([wrong[0], fleet / "c", *wrong[1:]])
    assert names(found.recordings) == ["c"]
    assert [error.where for error in found.errors] == [str(path) for path in wrong]
    expected = ["no such file", "is empty", "no recording in this folder", "not a recording of a known kind"]
    assert all(words in error.what for words, error in zip(expected, found.errors, strict=True))
    assert all(error.remedy and "\n" not in str(error) for error in found.errors)


def test_files_of_a_searched_folder_that_are_named_almost_like_recordings_are_told(fleet: Path, tmp_path: Path) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    overlooked = [tmp_path / name for name in (".att.mcap", "att.bag~", "att.db3.old", "att.mcap.1")]
    for path in (*overlooked, tmp_path / "._two.mcap", tmp_path / "mcap.txt", tmp_path / "two.mcap-notes"):
        path.touch()
    found = find_recordings([tmp_path])
    assert names(found.recordings) == ["two.mcap"]
    assert [error.where for error in found.errors] == [str(path) for path in overlooked]
    assert all("named almost like a recording" in error.what and "rename it" in error.remedy for error in found.errors)


@pytest.mark.parametrize(
    ("name", "source", "kind"),
    [
        ("noext", "b/two.mcap", ".mcap"),
        ("drive.log", "b/two.mcap", ".mcap"),
        ("two.mcap (copy)", "b/two.mcap", ".mcap"),
        ("drive.rosbag", "a/deep/three.bag", ".bag"),
        ("drive.sqlite", "c/c.db3", ".db3"),
    ],
)
def test_a_recording_under_another_name_is_told_in_a_searched_folder_and_where_it_is_given(
    fleet: Path, tmp_path: Path, name: str, source: str, kind: str
) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    (tmp_path / "deeper").mkdir()
    disguised = tmp_path / "deeper" / name
    shutil.copy(fleet / source, disguised)
    for given in (tmp_path, disguised):
        [error] = find_recordings([given]).errors
        assert (error.where, error.what) == (
            str(disguised),
            f"by its bytes it is an {kind} file, and by its name none: it was not read",
        )
        assert f"end with {kind}" in error.remedy


def test_an_archive_of_recordings_is_told(fleet: Path, tmp_path: Path) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    with tarfile.open(tmp_path / "pack.tar", "w") as tar:
        for source in ("notes.txt", "c/c.db3", "a/deep/three.bag"):
            tar.add(fleet / source, source)
    with zipfile.ZipFile(tmp_path / "pack.zip", "w") as packed:
        packed.write(fleet / "notes.txt", "notes.txt")
        packed.write(fleet / "b" / "two.mcap", "b/two.mcap")
    assert [error.what for error in find_recordings([tmp_path]).errors] == [
        "an archive of c.db3 and 1 more recordings: it was not read",
        "an archive of two.mcap: it was not read",
    ]


def test_what_files_are_by_their_bytes_takes_one_opening_of_each(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("two.mcap", "noext"):
        shutil.copy(fleet / "b" / "two.mcap", tmp_path / name)
    with zipfile.ZipFile(tmp_path / "pack.zip", "w") as packed:
        packed.write(fleet / "b" / "two.mcap", "b/two.mcap")
    (tmp_path / "two.mcap.txt").write_text("a note")
    opened: list[str] = []
    monkeypatch.setattr(opening_of_paths, "open_regular", lambda path: opened.append(path.name) or open_regular(path))
    located = find_recordings([tmp_path])
    assert [Path(str(error.where)).name for error in located.errors] == ["noext", "pack.zip"]
    assert opened == ["noext", "pack.zip", "two.mcap.txt"]


def test_other_files_links_to_what_is_read_and_what_datasets_hold_are_no_recordings_under_other_names(
    fleet: Path, tmp_path: Path
) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    (tmp_path / "latest").symlink_to(tmp_path / "two.mcap")
    with closing(sqlite3.connect(tmp_path / "other.sqlite")) as database:
        database.execute("CREATE TABLE messages (id)")
    with zipfile.ZipFile(tmp_path / "texts.zip", "w") as packed:
        packed.write(fleet / "notes.txt", "notes.txt")
    (tmp_path / "drive" / "image_00" / "data").mkdir(parents=True)
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "drive" / "image_00" / "data" / "0000000000.png")
    (tmp_path / "short").write_bytes(b"PK\3\4PK\1\2")
    (tmp_path / "cut.tar").write_bytes(bytes(257) + b"ustar")
    found = find_recordings([tmp_path])
    assert not found.errors
    assert names(found.recordings) == ["drive", "two.mcap"]


@pytest.mark.parametrize("left", ["", "rosbag2_bagfile_information:\n  version: 5\n"])
def test_a_folder_of_which_only_its_metadata_arrived_is_told_beside_others(
    fleet: Path, tmp_path: Path, left: str
) -> None:
    shutil.copytree(fleet / "c", tmp_path / "whole")
    for name, text in (("only", left), ("pictures", "license: none\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "metadata.yaml").write_text(text)
    found = find_recordings([tmp_path])
    assert names(found.recordings) == ["whole"]
    [error] = found.errors
    assert (error.where, error.what) == (
        str(tmp_path / "only"),
        "a rosbag2 folder of which only metadata.yaml is there",
    )


def test_a_pipe_or_socket_in_a_folder_is_told_and_nothing_is_read_from_it(fleet: Path, tmp_path: Path) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    pipe, named = tmp_path / "pipe.mcap", tmp_path / "socket.db3"
    os.mkfifo(pipe)
    other_end = os.open(pipe, os.O_RDWR)
    os.write(other_end, b"a" * 4096)
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(named))
    found = find_recordings([tmp_path])
    assert names(found.recordings) == ["two.mcap"]
    assert [error.where for error in found.errors] == [str(pipe), str(named)]
    assert os.read(other_end, 4097) == b"a" * 4096
    os.close(other_end)


def test_a_pipe_in_place_of_a_dataset_s_file_is_an_error_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "calib.txt")
    with pytest.raises(RecordingError, match="it is no regular file"):
        FileContent(tmp_path / "calib.txt")


def test_of_a_packed_recording_that_is_not_read_the_command_that_unpacks_it_is_told(
    fleet: Path, tmp_path: Path
) -> None:
    shutil.copy(fleet / "b" / "two.mcap", tmp_path / "two.mcap")
    packed = tmp_path / "one two.mcap.gz"
    packed.write_bytes(gzip.compress((fleet / "b" / "two.mcap").read_bytes()))
    for given in (tmp_path, packed):
        [error] = find_recordings([given]).errors
        assert (error.what, error.where) == ("a recording packed as .gz is not read", str(packed))
        assert error.remedy.startswith("unpack it: gunzip 'one two.mcap.gz'")
    (tmp_path / "notes.gz").touch()
    assert "known kind" in find_recordings([tmp_path / "notes.gz"]).errors[0].what


def test_the_format_of_a_recording_is_the_name_of_its_reader(fleet: Path, tmp_path: Path) -> None:
    (tmp_path / "drive" / "image_00" / "data").mkdir(parents=True)
    places = ("b/one.MCAP", "a/deep/three.bag", "c", "c/c.db3", "notes.txt", ".hidden")
    assert [format_of(fleet / place) for place in places] == ["mcap", "bag", "rosbag2", "rosbag2", None, None]
    assert format_of(tmp_path / "drive") == "kitti"


@pytest.mark.parametrize("name", ["missing.mcap", "empty.bag", "text.txt"])
def test_opening_a_path_that_is_not_a_recording_is_a_clear_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty.bag").touch()
    (tmp_path / "text.txt").write_text("x")
    with pytest.raises(RecordingError, match=name):
        open_recording(tmp_path / name)


def test_a_folder_that_links_to_itself_ends(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path)
    assert not find_recordings([tmp_path]).recordings


def test_the_real_data_are_found(real_data: Path) -> None:
    found = names(find_recordings([real_data]).recordings)
    kitti = [f"kitti_raw_2011_09_26_drive_{number}" for number in ("0001", "0009", "0048")]
    assert {*kitti, "ros1_tilt_laser.bag", "ros2_vlp16"} <= set(found)
    assert len(set(found)) == len(found)

"""Which files are one recording: the parts of a split drive, and files that were recorded side by side."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from auditor.model.frames import Message
from auditor.recordings import Location, find_recordings, find_rigs, open_recording, parts, schemas, search_rigs, survey
from auditor.recordings.parameters import DRIVE_PARTS
from tests.making.recorded_drives import PERIOD_NS, START_NS, make_frame, make_frames, make_rig, split, stream_of
from tests.making.split_drives import SUFFIXES, messages_of, some, write_messages, write_parts

RIG = make_rig(2)
FRAMES = 12


def at(frame: int) -> int:
    """A time just before a frame."""
    return START_NS + frame * PERIOD_NS - 1


@pytest.fixture(scope="module", params=SUFFIXES)
def suffix(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def recorded(suffix: str) -> list[Message]:
    return messages_of(suffix, RIG, make_frames(RIG, FRAMES))


@pytest.fixture(scope="module")
def in_mcap() -> list[Message]:
    return messages_of(".mcap", RIG, make_frames(RIG, FRAMES))


def found(*paths: Path) -> list[Location]:
    result = find_recordings(paths)
    assert not result.errors
    return list(result.recordings)


def names(locations: Sequence[Location]) -> list[list[str]]:
    """The file names of each recording."""
    return [[file.name for stream in location.streams for file in stream] or [location.name] for location in locations]


def later(recorded: list[Message], by_ns: int) -> list[Message]:
    return [Message(m.topic, m.schema, m.encoding, m.log_time_ns + by_ns, m.data) for m in recorded]


def stamps(location: Location) -> list[int]:
    with open_recording(location) as recording:
        frames, skipped = split(stream_of(recording))
    assert not skipped
    return [frame.stamp_ns for frame in frames]


def identity(location: Location) -> tuple[str, tuple[str, ...]]:
    with open_recording(location) as recording:
        return recording.recording_id, tuple(file.name for file in recording.files)


def test_the_parts_of_a_split_drive_are_one_recording_with_the_frames_of_the_whole(
    tmp_path: Path, suffix: str, recorded: list[Message]
) -> None:
    parts = write_parts(tmp_path / "log", suffix, recorded, (at(4), at(8)))
    for paths in (parts, [parts[2], parts[0], parts[1]], [tmp_path / "log"], [tmp_path]):
        (location,) = found(*paths)
        assert location.path in {tmp_path / "log" / "drive", tmp_path / "log"}
        assert stamps(location) == [START_NS + number * PERIOD_NS for number in range(FRAMES)]
    ids = {identity(location) for paths in (parts, [tmp_path / "log"]) for location in found(*paths)}
    assert {files for _, files in ids} == {tuple(part.name for part in parts)}
    assert len(ids) == 1


def test_a_folder_with_metadata_is_the_same_recording_as_its_files(
    tmp_path: Path, recorded: list[Message], suffix: str
) -> None:
    parts = write_parts(tmp_path / "log", suffix, recorded, (at(4),))
    before = identity(found(*parts)[0])
    (tmp_path / "log" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    assert identity(found(tmp_path / "log")[0]) == identity(found(*parts)[0]) == before


def test_the_parts_of_rosbag_have_their_own_dates_in_their_names(tmp_path: Path) -> None:
    recorded = messages_of(".bag", RIG, make_frames(RIG, FRAMES))
    parts = write_parts(tmp_path, ".bag", recorded, (at(4), at(8)))
    dated = [
        part.rename(tmp_path / f"night_2026-01-31-10-0{number}-00_{number}.bag") for number, part in enumerate(parts)
    ]
    (location,) = found(*dated)
    assert location.name == "night_2026-01-31-10-00-00"
    assert len(stamps(location)) == FRAMES


def test_a_bag_that_was_not_closed_is_the_last_part(tmp_path: Path) -> None:
    recorded = messages_of(".bag", RIG, make_frames(RIG, FRAMES))
    first, second = write_parts(tmp_path, ".bag", recorded, (at(6),))
    data = second.read_bytes()
    index = data.index(b"index_pos=") + len(b"index_pos=")
    second.with_suffix(".bag.active").write_bytes(data[:index] + bytes(8) + data[index + 8 :])
    second.unlink()
    (location,) = found(tmp_path)
    assert names([location]) == [["drive_0.bag", "drive_1.bag.active"]]
    assert len(stamps(location)) == FRAMES
    assert location.first == first


def test_parts_without_an_index_are_put_together(tmp_path: Path, in_mcap: list[Message]) -> None:
    for number in (0, 1):
        chosen = some(in_mcap, lambda message, number=number: (message.log_time_ns >= at(6)) == bool(number))
        write_messages(tmp_path / f"drive_{number}.mcap", chosen, indexed=False)
    cut = tmp_path / "drive_0.mcap"
    cut.write_bytes(cut.read_bytes()[:-40])
    assert names(found(tmp_path)) == [["drive_0.mcap", "drive_1.mcap"]]


def test_the_tenth_part_comes_after_the_ninth(tmp_path: Path, in_mcap: list[Message]) -> None:
    write_parts(tmp_path, ".mcap", in_mcap, [at(frame) for frame in range(1, FRAMES)])
    (location,) = found(tmp_path)
    assert len(stamps(location)) == FRAMES


def test_interleaved_drives_of_the_same_numbers_are_followed_each_by_its_own_parts(
    tmp_path: Path, in_mcap: list[Message]
) -> None:
    hour_ns = 3600 * 10**9
    later = messages_of(
        ".mcap", RIG, [make_frame(RIG, n, stamp_ns=START_NS + hour_ns + n * PERIOD_NS) for n in range(FRAMES)]
    )
    first = write_parts(tmp_path / "a", ".mcap", in_mcap, (at(4), at(8)))
    second = write_parts(tmp_path / "b", ".mcap", later, (at(4) + hour_ns, at(8) + hour_ns))
    paths = [path for pair in zip(second, first, strict=True) for path in pair]
    moved = [path.rename(tmp_path / f"drive_{place:02}.mcap") for place, path in enumerate(paths)]
    assert names(found(*moved)) == [[f"drive_{n:02}.mcap" for n in places] for places in ((0, 2, 4), (1, 3, 5))]


def test_each_of_many_numbered_files_is_compared_with_those_of_the_numbers_before_it_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    many, compared = 300, []
    length_ns, apart_ns = 10**9, 3600 * 10**9
    spans = {f"drive_{n}.mcap": (n * apart_ns, n * apart_ns + length_ns) for n in range(many)}

    class Summary:
        """What is known of a file that nobody has to write."""

        def __init__(self, file: Path) -> None:
            self.file, self.span_ns, self.sensors = file, spans[file.name], frozenset({file.name})

    follows = parts._follows
    monkeypatch.setattr(parts, "FileSummary", Summary)
    monkeypatch.setattr(parts, "_follows", lambda *of: compared.append(of) or follows(*of))
    assert len({*parts.grouped([Path(name) for name in spans], lambda _: ()).values()}) == many
    assert many - 1 <= len(compared) <= many * (DRIVE_PARTS.most_missing + 1)


def test_drives_that_only_look_alike_stay_apart(tmp_path: Path, in_mcap: list[Message]) -> None:
    later = messages_of(
        ".mcap", RIG, [make_frame(RIG, n, stamp_ns=START_NS + 3600 * 10**9 + n * PERIOD_NS) for n in range(3)]
    )
    write_messages(tmp_path / "far" / "run_0.mcap", in_mcap)
    write_messages(tmp_path / "far" / "run_1.mcap", later)
    assert names(found(tmp_path / "far")) == [["run_0.mcap"], ["run_1.mcap"]]
    write_messages(tmp_path / "same_time" / "run_0.mcap", in_mcap)
    write_messages(tmp_path / "same_time" / "run_1.mcap", in_mcap[:-1])
    assert names(found(tmp_path / "same_time")) == [["run_0.mcap"], ["run_1.mcap"]]
    write_parts(tmp_path / "other_names", ".mcap", in_mcap, (at(6),))
    (tmp_path / "other_names" / "drive_1.mcap").rename(tmp_path / "other_names" / "ride_1.mcap")
    assert names(found(tmp_path / "other_names")) == [["drive_0.mcap"], ["ride_1.mcap"]]
    first, second = write_parts(tmp_path / "folders", ".mcap", in_mcap, (at(6),))
    (tmp_path / "folders" / "b").mkdir()
    second.rename(tmp_path / "folders" / "b" / second.name)
    assert len(found(tmp_path / "folders")) == 2
    assert first.exists()


def test_a_drive_of_another_vehicle_that_follows_at_once_stays_apart(tmp_path: Path, in_mcap: list[Message]) -> None:
    other = make_rig(2)
    for camera in other.cameras:
        camera.projection[0, 0] += 5
        camera.projection[1, 1] += 5
    after = messages_of(
        ".mcap", other, [make_frame(other, n, stamp_ns=START_NS + (FRAMES + n) * PERIOD_NS) for n in range(6)]
    )
    write_messages(tmp_path / "a" / "run_0.mcap", in_mcap)
    write_messages(tmp_path / "a" / "run_1.mcap", after)
    assert names(found(tmp_path / "a")) == [["run_0.mcap"], ["run_1.mcap"]]
    same = messages_of(
        ".mcap", RIG, [make_frame(RIG, n, stamp_ns=START_NS + (FRAMES + n) * PERIOD_NS) for n in range(6)]
    )
    write_messages(tmp_path / "b" / "run_0.mcap", in_mcap)
    write_messages(tmp_path / "b" / "run_1.mcap", same)
    assert names(found(tmp_path / "b")) == [["run_0.mcap", "run_1.mcap"]]


def test_folders_of_db3_files_of_several_drives_are_several_recordings(tmp_path: Path) -> None:
    recorded = messages_of(".db3", RIG, make_frames(RIG, 4))
    write_messages(tmp_path / "run_0.db3", recorded)
    write_messages(tmp_path / "run_1.db3", recorded)
    assert names(found(tmp_path)) == [["run_0.db3"], ["run_1.db3"]]


LISTS = (
    "  relative_file_paths:\n    - drive_0{kind}\n    - 'drive_1{kind}'\n    - \"drive_2{kind}\"\n  version: 4\n",
    "  relative_file_paths: [log/drive_0{kind}, 'drive_1{kind}',\r\n    ../drive_2{kind}]\r\n",
    "  relative_file_paths:\n  - drive_0{kind}.zstd\n  - drive_1{kind}.zstd\n  - drive_2{kind}\n",
)


@pytest.mark.parametrize("listed", LISTS)
@pytest.mark.parametrize("kind", [".db3", ".mcap"])
def test_a_last_part_that_the_metadata_list_and_that_is_missing_is_told(
    tmp_path: Path, in_mcap: list[Message], kind: str, listed: str
) -> None:
    recorded = in_mcap if kind == ".mcap" else messages_of(kind, RIG, make_frames(RIG, FRAMES))
    parts = write_parts(tmp_path / "log", kind, recorded, (at(4), at(8)))
    (tmp_path / "log" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n" + listed.format(kind=kind))
    assert not damage_of(tmp_path / "log")
    parts[2].rename(tmp_path / parts[2].name)  # beside the folder, where a name in the list leads
    assert damage_of(tmp_path / "log") == [f"drive_2{kind} is missing, which metadata.yaml lists"]
    assert damage_of(parts[0]) == [f"drive_2{kind} is missing, which metadata.yaml lists"]


@pytest.mark.parametrize(
    "listed",
    [
        b"relative_file_paths:\n- other_0.mcap\n- other_1.mcap\n",
        b"relative_file_paths:\n- drive_0.mcap\n- notes.txt\n- &a drive_9.mcap\n",
        b"relative_file_paths: [drive_0.mcap, drive_9.mcap",
        b'relative_file_paths:\n- drive_0.mcap\n- "drive_\\x39.mcap"\n',
        b"relative_file_paths:\n- drive_0.mcap\n- drive_9.mcap\n\xff",
        b"relative_file_paths:\n- drive_0.mcap\n- drive_9.mcap\n" + b"#" * 2**22,
        b"relative_file_paths: [" * 2**17,
        b"",
    ],
)
def test_metadata_of_another_recording_or_of_another_form_change_nothing(
    tmp_path: Path, in_mcap: list[Message], listed: bytes
) -> None:
    write_parts(tmp_path / "log", ".mcap", in_mcap, (at(4),))
    (tmp_path / "log" / "metadata.yaml").write_bytes(listed)
    assert damage_of(tmp_path / "log") == []


def damage_of(where: Path | Location) -> list[str]:
    with open_recording(where) as recording:
        assert list(recording.messages())
        return [str(piece) for piece in recording.damage]


def test_a_missing_part_is_told_and_the_others_are_one_recording(
    tmp_path: Path, suffix: str, recorded: list[Message]
) -> None:
    parts = write_parts(tmp_path, suffix, recorded, (at(4), at(8)))
    parts[1].unlink()
    (location,) = found(*parts[::2])
    with open_recording(location) as recording:
        frames, _ = split(stream_of(recording))
        told = [str(piece) for piece in recording.damage]
    assert [frame.stamp_ns for frame in frames] == [START_NS + n * PERIOD_NS for n in (0, 1, 2, 3, 8, 9, 10, 11)]
    assert told == [f"part 1 is missing between drive_0{suffix} and drive_2{suffix}"]


def test_a_hole_in_the_numbers_that_leaves_no_time_is_no_missing_part(
    tmp_path: Path, suffix: str, recorded: list[Message]
) -> None:
    parts = write_parts(tmp_path, suffix, recorded, (at(4), at(8)))
    parts[2].rename(tmp_path / f"drive_5{suffix}")
    (location,) = found(tmp_path)
    assert not damage_of(location)
    assert len(stamps(location)) == FRAMES


@pytest.mark.parametrize(
    "times",
    [
        ("20110926130824", "20110926130825", "20110926130827"),
        ("20110926125958", "20110926130058", "20110926130159"),
        ("2011-09-26T13-08-24Z", "2011-09-26T13-09-24Z", "2011-09-27T13-10-24Z"),
        ("2011_09_26-13_08_24", "2011_09_26-13_09_24", "2011_09_26-13_10_24"),
        ("1317042504", "1317042564", "1317042624"),
        ("1317042504123", "1317042564123", "1317042624123"),
        ("0858", "0859", "0900"),
        ("20110926_085959", "20110926_090000", "20110926_090001"),
    ],
)
def test_parts_named_by_their_time_are_one_recording_and_nothing_is_missing(
    tmp_path: Path, in_mcap: list[Message], times: Sequence[str]
) -> None:
    parts = write_parts(tmp_path, ".mcap", in_mcap, (at(4), at(8)))
    for part, time in zip(parts, times, strict=True):
        part.rename(tmp_path / f"rec_{time}.mcap")
    (location,) = found(tmp_path)
    assert location.name == f"rec_{times[0]}"
    assert not damage_of(location)
    assert len(stamps(location)) == FRAMES


@pytest.mark.parametrize(
    ("times", "gap_ns"),
    [
        (("20110926130824", "20110926130825"), DRIVE_PARTS.most_gap_ns),  # their messages lie too far apart
        (("0858", "1030"), 0),  # they begin at once, and not after an hour and a half
        (("0858", "085900"), 0),
        (("20110926130825", "1317042504"), 0),
    ],
)
def test_parts_named_by_other_times_than_their_own_stay_apart(
    tmp_path: Path, in_mcap: list[Message], times: Sequence[str], gap_ns: int
) -> None:
    before, after = (some(in_mcap, lambda m, late=late: (m.log_time_ns >= at(6)) == late) for late in (False, True))
    write_messages(tmp_path / f"rec_{times[0]}.mcap", before)
    write_messages(tmp_path / f"rec_{times[1]}.mcap", later(after, gap_ns))
    assert len(found(tmp_path)) == 2


def test_a_part_named_by_its_time_says_that_the_others_hold_the_calibration(
    tmp_path: Path, in_mcap: list[Message]
) -> None:
    first, second = write_parts(tmp_path, ".mcap", in_mcap, (at(6),))
    first.rename(tmp_path / "rec_20110926130824.mcap")
    with open_recording(second.rename(tmp_path / "rec_20110926130924.mcap")) as recording:
        assert "give rec_20110926130824.mcap too" in " ".join(search_rigs(survey(recording)).reasons)


def test_a_part_behind_too_many_missing_ones_is_a_recording_of_its_own(tmp_path: Path, in_mcap: list[Message]) -> None:
    parts = write_parts(tmp_path, ".mcap", in_mcap, [at(frame) for frame in range(1, 8)])
    for part in parts[1:-1]:
        part.unlink()
    assert names(found(tmp_path)) == [["drive_0.mcap"], ["drive_7.mcap"]]


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", bytes(1000)])
def test_a_part_that_is_empty_or_damaged_does_not_lose_the_others(
    tmp_path: Path, suffix: str, recorded: list[Message], content: bytes
) -> None:
    parts = write_parts(tmp_path, suffix, recorded, (at(4), at(8)))
    parts[1].write_bytes(content)
    (location,) = found(*parts)
    with open_recording(location) as recording:
        frames, _ = split(stream_of(recording))
        assert {piece.file for piece in recording.damage} == {parts[1].name}
    assert len(frames) == 8


def test_what_cannot_be_read_behind_the_last_part_stays_by_itself(tmp_path: Path, in_mcap: list[Message]) -> None:
    write_parts(tmp_path, ".mcap", in_mcap, (at(6),))
    for name in ("drive_2.mcap", "drive_3.mcap", "drive_03.mcap"):
        (tmp_path / name).write_bytes(bytes(100))
    assert sorted(names(found(tmp_path))) == [
        ["drive_0.mcap", "drive_1.mcap"],
        ["drive_03.mcap"],
        ["drive_2.mcap"],
        ["drive_3.mcap"],
    ]


def test_cut_copies_of_one_recording_stay_apart(tmp_path: Path, suffix: str, recorded: list[Message]) -> None:
    content = write_messages(tmp_path / f"whole{suffix}", recorded).read_bytes()
    for place in range(1, 5):
        (tmp_path / "cuts").mkdir(exist_ok=True)
        (tmp_path / "cuts" / f"cut_{place}{suffix}").write_bytes(content[: len(content) * place // 5])
    assert len(found(tmp_path / "cuts")) == 4


def test_a_part_alone_says_that_the_others_hold_the_calibration(tmp_path: Path, in_mcap: list[Message]) -> None:
    _, second = write_parts(tmp_path, ".mcap", in_mcap, (at(6),))
    with open_recording(second) as recording:
        found = search_rigs(survey(recording))
    assert [one.cameras for one in found.rigs] == [()], "the LiDAR is a rig alone"
    assert any("give drive_0.mcap too" in str(reason) for reason in found.reasons)


def cameras_and_lidar(folder: Path, suffix: str, recorded: list[Message], names: tuple[str, str]) -> list[Path]:
    """The LiDAR in one file, all other messages in another."""
    return [
        write_messages(folder / f"{names[0]}{suffix}", some(recorded, lambda m: m.schema != schemas.POINT_CLOUD)),
        write_messages(folder / f"{names[1]}{suffix}", some(recorded, lambda m: m.schema == schemas.POINT_CLOUD)),
    ]


def test_cameras_and_lidar_in_two_files_are_one_recording(tmp_path: Path, suffix: str, recorded: list[Message]) -> None:
    files = cameras_and_lidar(tmp_path, suffix, recorded, ("cams", "velo"))
    (location,) = found(*files)
    assert location.path == tmp_path / "cams+velo"
    assert stamps(location) == [START_NS + number * PERIOD_NS for number in range(FRAMES)]
    assert {identity(one)[0] for paths in (files, files[::-1], [tmp_path]) for one in found(*paths)} == {
        identity(location)[0]
    }
    with open_recording(location) as recording:
        surveyed = survey(recording)
        times = [message.log_time_ns for message in recording.messages()]
    assert surveyed.interleaved
    assert times == sorted(times)
    assert find_rigs(surveyed)[0].sensors == (0, 1, 2)


def test_split_cameras_and_a_split_lidar_are_one_recording(tmp_path: Path, in_mcap: list[Message]) -> None:
    files = cameras_and_lidar(tmp_path / "whole", ".mcap", in_mcap, ("cams", "velo"))
    for file, starts in zip(files, ((at(4), at(8)), (at(6),)), strict=True):
        with open_recording(file) as recording:
            write_parts(tmp_path / "split", ".mcap", list(recording.messages()), starts, file.stem)
    (location,) = found(tmp_path / "split")
    assert location.name == "cams+velo"
    assert len(stamps(location)) == FRAMES


def test_damage_of_files_side_by_side_names_its_file(tmp_path: Path, in_mcap: list[Message]) -> None:
    _, velo = cameras_and_lidar(tmp_path, ".mcap", in_mcap, ("cams", "velo"))
    data = bytearray(velo.read_bytes())
    data[200:260] = bytes(60)
    velo.write_bytes(data)
    (location,) = found(tmp_path)
    with open_recording(location) as recording:
        list(recording.messages())
        assert {piece.file for piece in recording.damage} == {"velo.mcap"}


def test_files_of_the_same_time_with_a_rig_each_stay_apart(tmp_path: Path, in_mcap: list[Message]) -> None:
    write_messages(tmp_path / "one.mcap", in_mcap)
    renamed = [
        Message(f"/other{m.topic}", m.schema, m.encoding, m.log_time_ns, m.data)
        for m in in_mcap
        if m.schema != schemas.TRANSFORMS
    ]
    transforms = some(in_mcap, lambda message: message.schema == schemas.TRANSFORMS)
    write_messages(tmp_path / "two.mcap", [*transforms, *renamed])
    assert names(found(tmp_path)) == [["one.mcap"], ["two.mcap"]]


def test_cameras_and_lidar_of_different_times_or_folders_stay_apart(tmp_path: Path, in_mcap: list[Message]) -> None:
    late = some(in_mcap, lambda m: m.log_time_ns >= at(10) or m.schema in {schemas.TRANSFORMS, schemas.CAMERA_INFO})
    cameras, _ = cameras_and_lidar(tmp_path / "a", ".mcap", in_mcap, ("cams", "velo"))
    clouds = some(late, lambda m: m.schema == schemas.POINT_CLOUD)
    moved = [Message(m.topic, m.schema, m.encoding, m.log_time_ns + 2 * 10**9, m.data) for m in clouds]
    write_messages(tmp_path / "a" / "velo.mcap", moved)
    assert len(found(tmp_path / "a")) == 2
    files = cameras_and_lidar(tmp_path / "b", ".mcap", in_mcap, ("cams", "velo"))
    (tmp_path / "b" / "deep").mkdir()
    shutil.move(files[1], tmp_path / "b" / "deep" / "velo.mcap")
    assert len(found(tmp_path / "b")) == 2
    assert cameras.exists()


@pytest.fixture(scope="module")
def by_three() -> list[Message]:
    """Three cameras, which are a rig without their LiDAR."""
    rig = make_rig(3)
    return messages_of(".mcap", rig, make_frames(rig, FRAMES))


def test_cameras_that_are_a_rig_without_the_lidar_are_one_recording_with_it(
    tmp_path: Path, by_three: list[Message]
) -> None:
    cameras_and_lidar(tmp_path, ".mcap", by_three, ("cameras", "lidar"))
    (location,) = found(tmp_path)
    with open_recording(location) as recording:
        assert find_rigs(survey(recording))[0].sensors == (0, 1, 2, 3)
    (remark,) = location.remarks
    assert "cameras.mcap, lidar.mcap; if they are of several vehicles" in remark


def test_a_lidar_that_tf_does_not_connect_with_the_cameras_stays_apart(tmp_path: Path, by_three: list[Message]) -> None:
    placed = some(by_three, lambda m: m.schema != schemas.TRANSFORMS)
    cameras_and_lidar(tmp_path, ".mcap", placed, ("cameras", "lidar"))
    assert names(found(tmp_path)) == [["cameras.mcap"], ["lidar.mcap"]]


@pytest.mark.parametrize("kind", [".mcap", ".db3"])
def test_two_rosbag2_folders_of_the_same_time_are_one_recording(
    tmp_path: Path, by_three: list[Message], kind: str
) -> None:
    for file in cameras_and_lidar(tmp_path, kind, by_three, ("cameras", "lidar")):
        folder = tmp_path / "drive" / file.stem
        folder.mkdir(parents=True)
        (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
        file.rename(folder / f"{file.stem}_0{kind}")
    (location,) = found(tmp_path / "drive")
    assert (location.path, location.given) == (tmp_path / "drive" / "cameras+lidar", tmp_path / "drive" / "cameras")
    assert {one.path for one in found(tmp_path / "drive" / "lidar", tmp_path / "drive" / "cameras")} == {location.path}
    assert len(stamps(location)) == FRAMES
    assert f"cameras/cameras_0{kind}, lidar/lidar_0{kind};" in location.remarks[0]
    before = identity(location)
    shutil.move(tmp_path / "drive", tmp_path / "moved")
    assert identity(found(tmp_path / "moved")[0]) == before


@pytest.mark.parametrize(
    ("vehicles", "together"),
    [
        ((("alder_cameras", "alder_lidar"), ("birch_cameras", "birch_lidar")), 2),
        ((("cameras-2", "lidar-2"), ("cameras-1", "lidar-1")), 2),
        ((("cameras", "lidar"), ("pictures", "points")), 0),
    ],
)
def test_of_two_vehicles_in_one_folder_those_files_are_one_recording_that_names_put_together(
    tmp_path: Path, by_three: list[Message], vehicles: tuple[tuple[str, str], ...], together: int
) -> None:
    cameras_and_lidar(tmp_path, ".mcap", by_three, vehicles[0])
    others = later(by_three, PERIOD_NS // 4)
    clouds = later(some(others, lambda m: m.schema == schemas.POINT_CLOUD), -PERIOD_NS // 3)  # before the other LiDAR's
    cameras_and_lidar(
        tmp_path, ".mcap", [*some(others, lambda m: m.schema != schemas.POINT_CLOUD), *clouds], vehicles[1]
    )
    pairs = [sorted(file.removesuffix(".mcap") for file in each) for each in names(found(tmp_path)) if len(each) > 1]
    assert sorted(pairs) == sorted(map(sorted, vehicles[:together]))


def test_a_copy_of_the_lidar_s_file_does_not_take_the_lidar_from_the_cameras(
    tmp_path: Path, by_three: list[Message]
) -> None:
    _, lidar = cameras_and_lidar(tmp_path, ".mcap", by_three, ("cameras", "lidar"))
    shutil.copy(lidar, tmp_path / "lidar of copies.mcap")
    assert sorted(map(len, names(found(tmp_path)))) == [1, 2]

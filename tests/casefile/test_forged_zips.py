"""A signed zip into which somebody has put something is no case, however right the signature of what was there."""

import shutil
import stat
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile, ZipInfo

import pytest

from auditor.casefile.checking import check_case
from auditor.casefile.write import write_zip
from auditor.cli import run
from auditor.errors import SettingError
from auditor.store.log.signatures import public_key

Forge = Callable[[ZipFile], None]


def member(name: str, mode: int = stat.S_IFREG | 0o600) -> ZipInfo:
    info = ZipInfo(name)
    info.external_attr = mode << 16
    return info


def flagged(archive: ZipFile) -> None:
    archive.writestr(member("case/secret"), b"x")
    archive.getinfo("case/secret").flag_bits |= 1


def renamed(archive: ZipFile) -> None:
    info = member("case/more.json")
    info.extra = struct.pack("<HH", 0x7075, 12) + bytes(12)
    archive.writestr(info, b"x")


FORGED: dict[str, tuple[Forge, str]] = {
    "beside the folder": (lambda a: a.writestr("ticket.json", b"x"), "do not lie in one folder"),
    "another folder": (lambda a: a.writestr("other/ticket.json", b"x"), "do not lie in one folder"),
    "twice": (lambda a: a.writestr("case/ticket.json", b"x"), "has the name of another"),
    "twice by case": (lambda a: a.writestr("case/Ticket.JSON", b"x"), "has the name of another"),
    "twice by Unicode": (lambda a: a.writestr("case/\uff54icket.json", b"x"), "has the name of another"),
    "twice by dots": (lambda a: a.writestr("case/ticket.json.", b"x"), "has the name of another"),
    "backslash": (lambda a: a.writestr(member("case\\ticket.json"), b"x"), "different ways"),
    "drive": (lambda a: a.writestr("c:/ticket.json", b"x"), "different ways"),
    "control": (lambda a: a.writestr("case/a\nb", b"x"), "different ways"),
    "parent": (lambda a: a.writestr("case/../ticket.json", b"x"), "out of its folder"),
    "absolute": (lambda a: a.writestr(member("/case/more"), b"x"), "out of its folder"),
    "here": (lambda a: a.writestr("case/./more", b"x"), "out of its folder"),
    "empty part": (lambda a: a.writestr("case//more", b"x"), "out of its folder"),
    "link": (lambda a: a.writestr(member("case/more", stat.S_IFLNK | 0o777), b"/etc"), "link or a device"),
    "pipe": (lambda a: a.writestr(member("case/more", stat.S_IFIFO | 0o600), b""), "link or a device"),
    "folder with data": (lambda a: a.writestr(member("case/more/", 0), b"x"), "folder and a file at once"),
    "file that is a folder": (
        lambda a: a.writestr(member("case/more", stat.S_IFDIR | 0o700), b""),
        "folder and a file at once",
    ),
    "file in a file": (lambda a: a.writestr("case/ticket.json/more", b"x"), "a file that has files in it"),
    "encrypted": (flagged, "is encrypted"),
    "bzip2": (lambda a: a.writestr("case/more", b"x", zipfile.ZIP_BZIP2), "neither stored nor deflated"),
    "second name": (renamed, "has a second name"),
}


@pytest.fixture(scope="module")
def whole(lidar_case: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip of a signed case."""
    folder = Path(shutil.copytree(lidar_case, tmp_path_factory.mktemp("whole") / "case"))
    write_zip(folder, folder.with_name("case.zip"))
    return folder.with_name("case.zip")


@pytest.fixture
def forged(whole: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    return Path(shutil.copy(whole, tmp_path / "forged.zip"))


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("way", FORGED)
def test_a_zip_that_may_show_others_something_else_is_refused(way: str, forged: Path) -> None:
    forge, says = FORGED[way]
    with ZipFile(forged, "a") as archive:
        forge(archive)
    with pytest.raises(SettingError, match=says) as caught:
        check_case(forged)
    assert len(str(caught.value).splitlines()) == 1


def test_the_original_beside_a_changed_file_does_not_verify(
    whole: Path, tmp_path: Path, private_key: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with ZipFile(whole) as source, ZipFile(tmp_path / "forged.zip", "w") as target:
        for name in source.namelist():
            content = source.read(name)
            target.writestr(name, b"{}" if name == "case/ticket.json" else content)
            if name == "case/ticket.json":
                target.writestr("ticket.json", content)
    key = private_key.with_name("public.pem")
    assert check_case(whole, public_key(key)).problems == ()
    assert run(["verify", str(tmp_path / "forged.zip"), "--public-key", str(key)]) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert "its members do not lie in one folder" in line


@pytest.mark.parametrize("place", ["before", "behind"])
def test_bytes_that_belong_to_no_member_are_refused(place: str, forged: Path) -> None:
    content = forged.read_bytes()
    forged.write_bytes(b"PK" + content if place == "before" else content + b"more")
    with pytest.raises(SettingError, match=r"bytes that belong to none|does not end with its directory"):
        check_case(forged)


def test_a_removed_member_whose_bytes_are_still_there_is_refused(forged: Path) -> None:
    with ZipFile(forged, "a") as archive:
        archive.writestr("case/hidden", b"x")
        archive.filelist.pop()
        archive.comment = b""
    with pytest.raises(SettingError, match="bytes that belong to none"):
        check_case(forged)


def test_a_damaged_member_is_one_line(forged: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with ZipFile(forged) as archive:
        place = archive.getinfo("case/ticket.json").header_offset + 60
    content = bytearray(forged.read_bytes())
    content[place : place + 20] = b"\xff" * 20
    forged.write_bytes(bytes(content))
    assert run(["verify", str(forged)]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1


def test_links_to_folders_are_told_as_links_to_files_are(lidar_case: Path, tmp_path: Path) -> None:
    case = Path(shutil.copytree(lidar_case, tmp_path / "case"))
    (tmp_path / "elsewhere").mkdir()
    (case / "more").symlink_to(tmp_path / "elsewhere")
    (case / "pictures").rename(tmp_path / "pictures")
    (case / "pictures").symlink_to(tmp_path / "pictures")
    problems = check_case(case).problems
    assert "more: it was added: the manifest does not name it" in problems
    assert "pictures: it was added: the manifest does not name it" in problems
    assert any(problem.startswith("pictures/") and problem.endswith("it is missing") for problem in problems)


def test_a_manifest_that_names_a_file_twice_is_none(lidar_case: Path, tmp_path: Path) -> None:
    case = Path(shutil.copytree(lidar_case, tmp_path / "case"))
    text = (case / "manifest.json").read_text()
    (case / "manifest.json").write_text(text.replace("clip.mcap", "ticket.json"))
    with pytest.raises(SettingError, match="is no manifest of a case"):
        check_case(case)

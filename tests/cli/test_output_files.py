"""An existing file is not written over, unless the same command made it, and a refused command writes nothing."""

from pathlib import Path

import pytest

from auditor.cli import run
from tests.making.small_drives import THREE_CAMERAS, write_drive

MINE = b"the only copy of a drive"


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drives") / "clean.mcap", count=12, positions_m=THREE_CAMERAS)


@pytest.fixture(scope="module")
def store(clean: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store") / "audit"
    assert run(["calibrate", str(clean), "-r", "0", "--store", str(folder)]) == 0
    return folder


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    (tmp_path / "mine.mcap").write_bytes(MINE)
    return tmp_path / "mine.mcap"


def error_line(capfd: pytest.CaptureFixture[str]) -> str:
    """The one line of an error."""
    [line] = [line for line in capfd.readouterr().err.splitlines() if line.startswith("auditor: ")]
    return line


@pytest.mark.parametrize("verb", ["calibrate", "report"])
def test_out_spares_what_the_command_did_not_make(verb: str, store: Path, mine: Path, capfd) -> None:
    command = [verb, *([str(store), "-r", "0"] if verb == "calibrate" else []), "--store", str(store)]
    page = mine.rename(mine.with_suffix(".html"))
    for target, is_what in ((page, "is not "), (made_folder(mine.parent / "folder.html"), "is a folder")):
        assert run([*command, "--out", str(target)]) == 2
        assert f"{target}: it exists already and {is_what}" in error_line(capfd)
    assert page.read_bytes() == MINE
    for _ in range(2):  # what it made itself it makes again
        assert run([*command, "--out", str(mine.parent / "own.html")]) == 0


def test_pages_of_a_folder_spare_pages_that_somebody_else_made(store: Path, mine: Path, tmp_path: Path, capfd) -> None:
    assert run(["report", "--store", str(store), "--out", str(mine)]) == 2
    assert f"{mine}: it is a file; name a folder, or a file that ends in .html" in error_line(capfd)
    incidents = made_folder(tmp_path / "pages" / "incidents")
    (incidents / "own.html").write_text("mine")
    assert run(["report", "--store", str(store), "--out", str(incidents.parent)]) == 2
    assert "own.html: it exists already and is not a page that auditor wrote" in error_line(capfd)
    assert [path.name for path in incidents.parent.iterdir()] == ["incidents"]
    (incidents / "own.html").unlink()
    for _ in range(2):
        assert run(["report", "--store", str(store), "--out", str(incidents.parent)]) == 0
    assert (incidents.parent / "index.html").is_file()


def made_folder(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder


def test_a_pattern_after_out_costs_no_recording_and_no_work(clean: Path, mine: Path, tmp_path: Path, capfd) -> None:
    """The shell makes one `--out` and many recordings of `--out clean_logs/*.mcap`."""
    assert run(["calibrate", "--store", str(tmp_path / "audit"), "--out", str(mine), str(clean)]) == 2
    assert "not a thresholds artefact" in error_line(capfd)
    assert mine.read_bytes() == MINE
    assert not (tmp_path / "audit").exists()


def test_a_rig_file_that_was_corrected_is_not_written_over(clean: Path, tmp_path: Path, capfd) -> None:
    rig = tmp_path / "rig.toml"
    assert run(["inspect", str(clean), "--write-rig", str(rig)]) == 0
    assert f"the rig is in {rig}" in capfd.readouterr().err
    rig.write_text("corrected by hand")
    for target in (rig, tmp_path):
        assert run(["inspect", str(clean), "--write-rig", str(target)]) == 2
        assert "it exists already" in error_line(capfd)
    assert rig.read_text() == "corrected by hand"


def test_one_rig_file_cannot_be_that_of_two_recordings(clean: Path, tmp_path: Path, capfd) -> None:
    write_drive(tmp_path / "other.mcap", count=3, positions_m=(0.9, 0.0))
    rig = tmp_path / "rig.toml"
    assert run(["inspect", str(clean), str(tmp_path / "other.mcap"), "--write-rig", str(rig)]) == 2
    assert "these are 2 recordings" in error_line(capfd)
    assert not rig.exists()


@pytest.mark.parametrize(
    "content", [None, "nonsense = ", "[[cameras]]\nnumber = 1\n"], ids=["missing", "no toml", "no rig"]
)
@pytest.mark.parametrize("verb", ["scan", "calibrate"])
def test_a_bad_rig_file_is_the_command_s_error_and_makes_no_store(
    verb: str, content: str | None, clean: Path, tmp_path: Path, capfd
) -> None:
    rig = tmp_path / "rig.toml"
    if content is not None:
        rig.write_text(content)
    assert run([verb, str(clean), "--rig", str(rig), "--store", str(tmp_path / "audit")]) == 2
    assert str(rig) in error_line(capfd)
    assert not (tmp_path / "audit").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--from", "5", "--to", "2"], "from 5 s to 2 s"),
        (["--from", "1", "--to", "1"], "from 1 s to 1 s"),
        (["--from", "nan"], "from nan s to the end"),
        (["--to", "inf"], "from 0 s to inf s"),
        (["--from", "100"], "S_1, whose data ends 1.1 s after the recording's start"),
        (["--from", "0.11", "--to", "0.19"], "nothing was done to S_1"),
        (["--kind", "delayed", "--size", "50"], "nothing was done to S_1"),
    ],
)
def test_an_attack_that_attacks_nothing_is_an_error_and_writes_nothing(
    options: list[str], says: str, clean: Path, tmp_path: Path, capfd
) -> None:
    assert run(["attack", str(clean), str(tmp_path / "a.mcap"), "--on", "S_1", *options]) == 2
    assert says in error_line(capfd)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", [["attack", "--on", "S_1"], ["convert"]])
@pytest.mark.parametrize("name", ["b.bag", "b.db3", "b"])
def test_mcap_is_not_written_under_another_ending(
    verb: list[str], name: str, clean: Path, tmp_path: Path, capfd
) -> None:
    assert run([*verb, str(clean), str(tmp_path / name)]) == 2
    assert "recordings are written as MCAP; call it b.mcap" in error_line(capfd)
    assert not list(tmp_path.iterdir())

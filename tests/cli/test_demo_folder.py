"""A demo removes what an earlier one made, and nothing else."""

import shutil
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.errors import AuditorError
from auditor.lab.demo import fleet
from auditor.reporting.fleet import render_fleet_report
from auditor.reporting.incident.render import render_incident_report
from tests.making.report_stores import add_recording, new_store
from tests.making.small_drives import write_drive


@pytest.fixture(autouse=True)
def _renders_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object) -> None:
        raise AuditorError("the folder is ready")

    monkeypatch.setattr("auditor.cli.verbs.demo._record", stop)


@pytest.fixture(scope="module")
def left_behind(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a demo leaves behind, one that was killed too."""
    folder = tmp_path_factory.mktemp("demo")
    for take in (take for takes in fleet(folder) for take in takes if take.file.suffix != ".db3"):
        take.file.touch()
    write_drive(folder / "cedar_day.db3", count=1)
    (folder / ".cedar_day.db3.part" / "cedar_day.db3").mkdir(parents=True)
    for name in (
        ".auditor-demo",
        ".alder_night.mcap.part",
        ".cedar_day.db3.part/cedar_day.db3/cedar_day.db3.db3-journal",
    ):
        (folder / name).touch()
    store = new_store(folder)
    add_recording(store, "alder_night.mcap", attacks=[((3,), 4, 10)], pictured=[5])
    render_incident_report(store, out=folder / "audit" / "reports" / "incident.html")
    render_fleet_report(store, out=folder / "audit" / "reports")
    return folder


@pytest.fixture
def folder(left_behind: Path, tmp_path: Path) -> Path:
    """The same in a folder of the test's own."""
    return shutil.copytree(left_behind, tmp_path / "demo")


def demo(folder: Path, capfd: pytest.CaptureFixture[str]) -> str:
    assert run(["demo", str(folder)]) == 2
    return capfd.readouterr().err


def test_what_a_demo_made_is_removed(folder: Path, capfd) -> None:
    assert "the folder is ready" in demo(folder, capfd)
    assert [path.name for path in folder.iterdir()] == [".auditor-demo"]


@pytest.mark.parametrize(
    "name",
    ["notes.txt", "mine.mcap", "cedar_day.db3/mine.txt", "mine/notes.txt", "audit/mine.csv", "audit/reports/own.txt"],
)
def test_a_folder_with_something_of_the_user_s_is_refused_as_it_is(name: str, folder: Path, capfd) -> None:
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text("mine")
    before = sorted(folder.rglob("*"))
    assert f"holds {name}; move that elsewhere" in demo(folder, capfd)
    assert sorted(folder.rglob("*")) == before


def test_a_folder_that_no_demo_made_and_a_file_are_refused(tmp_path: Path, capfd) -> None:
    (tmp_path / "text.mcap").write_text("mine")
    assert "the folder is not empty" in demo(tmp_path, capfd)
    assert "text.mcap: it is a file" in demo(tmp_path / "text.mcap", capfd)
    assert (tmp_path / "text.mcap").read_text() == "mine"

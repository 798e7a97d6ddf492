"""Code of other packages that reads or measures is named, with its version, wherever versions are."""

from pathlib import Path

import pytest

from auditor.cli import run
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store.store import Store
from tests.making.small_drives import write_drive


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package of somebody else's that adds a matcher."""
    folder = tmp_path / "site" / "strangers_matcher-1.2.3.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers-matcher\nVersion: 1.2.3\n")
    (folder / "entry_points.txt").write_text("[auditor.matchers]\nstranger = strangers_matcher:Matcher\n")
    monkeypatch.syspath_prepend(tmp_path / "site")


def test_the_version_of_auditor_stands_beside_those_of_plug_ins(installed, capfd):
    assert run(["--version"]) == 0
    first, second = capfd.readouterr().out.splitlines()
    assert first.startswith("auditor, version ")
    assert second.startswith("plug-in strangers-matcher, version 1.2.3")


def test_without_plug_ins_it_stands_alone(capfd):
    assert run(["--version"]) == 0
    assert len(capfd.readouterr().out.splitlines()) == 1


def test_a_measurement_keeps_the_versions_of_plug_ins(installed, tmp_path):
    drive = write_drive(tmp_path / "drive.mcap", count=2)
    measured = measure_recording(MeasureTask(drive, tmp_path / "audit"), lambda *_: None)
    [known] = measured.measurement_ids
    assert Store.open(tmp_path / "audit").measurement(known).versions["strangers-matcher"] == "1.2.3"

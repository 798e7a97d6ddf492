"""Recordings of the same moments: copies, growing files, and twins with other bytes."""

import shutil
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT

INCIDENTS = ("query", "incidents", "--format", "json")
ATTACKED = record(WAGON, range(MOMENTS), attack=SPOT, seed=SEED)


@pytest.fixture(scope="module")
def scanned(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the attacked recording, log.mcap, and the store in which it was scanned."""
    folder = tmp_path_factory.mktemp("scanned")
    shutil.copytree(calibrated, folder / "audit")
    log = write(folder / "log.mcap", ATTACKED)
    assert run(["scan", str(log), "--store", str(folder / "audit")]) == Exit.FINDINGS
    return folder


@pytest.fixture
def audit_of_log(scanned: Path, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> Audit:
    """Verbs beside a store of the test's own, in which the attacked recording was scanned."""
    return Audit(shutil.copytree(scanned / "audit", tmp_path / "audit"), capfdbinary.readouterr)


def test_an_attacked_twin_of_a_clean_recording_is_found(audit: Audit, tmp_path: Path):
    assert audit.scan(write(tmp_path / "clean.mcap", record(WAGON, range(MOMENTS), seed=SEED))).code == Exit.CLEAN
    assert audit.scan(write(tmp_path / "log.mcap", ATTACKED)).code in {Exit.FINDINGS, Exit.FINDINGS_INCOMPLETE}


def test_a_cut_copy_of_an_attacked_recording_does_not_hide_it(audit_of_log: Audit, tmp_path: Path):
    audit_of_log.scan(write(tmp_path / "log.mcap", [sent for sent in ATTACKED if sent.moment < SPOT.moments.start]))
    assert len(audit_of_log(*INCIDENTS).rows) == 1

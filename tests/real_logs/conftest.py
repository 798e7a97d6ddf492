"""One store, calibrated on clean recordings of two vehicles of strangers, which each test gets a copy of."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from auditor.cli import run
from tests.making.audits import Audit
from tests.making.logs_of_strangers import DAY_NS, START_NS, record, write
from tests.making.vehicles_of_strangers import VAN, WAGON

CLEAN_SEEDS, CLEAN_MOMENTS = (11, 14), 8


@pytest.fixture(scope="session")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a calibration for each vehicle, from recordings of days before."""
    folder = tmp_path_factory.mktemp("calibrated")
    for vehicle in (WAGON, VAN):
        logs = []
        for day, seed in enumerate(CLEAN_SEEDS, start=1):
            log = record(vehicle, range(CLEAN_MOMENTS), seed=seed, start_ns=START_NS - day * DAY_NS)
            logs.append(write(folder / f"{vehicle.name}_{day}.mcap", log))
        assert run(["calibrate", *map(str, logs), "--store", str(folder / "audit")]) == 0
    return folder / "audit"


@pytest.fixture
def audits(calibrated: Path, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> Callable[[str], Audit]:
    """Verbs beside calibrated stores of the test's own, each with a name."""

    def audit(name: str) -> Audit:
        shutil.copytree(calibrated, tmp_path / name)
        return Audit(tmp_path / name, capfdbinary.readouterr)

    return audit


@pytest.fixture
def audit(audits: Callable[[str], Audit]) -> Audit:
    """Verbs beside a calibrated store of the test's own."""
    return audits("audit")


@pytest.fixture
def new_audit(tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> Audit:
    """Verbs beside a store that is not there yet."""
    return Audit(tmp_path / "new", capfdbinary.readouterr)

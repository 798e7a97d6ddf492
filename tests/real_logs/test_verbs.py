"""Verbs on recordings as strangers' recorders write them, in three containers."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import DAY_NS, START_NS, record, write
from tests.making.vehicles_of_strangers import VAN, WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT, WALL


@pytest.fixture(scope="module")
def fleet(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a clean and an attacked recording of each vehicle, in three containers."""
    folder = tmp_path_factory.mktemp("fleet")
    write(folder / "wagon_clean.db3", record(WAGON, range(MOMENTS), seed=SEED))
    write(folder / "wagon_spot.mcap", record(WAGON, range(MOMENTS), attack=SPOT, seed=SEED, start_ns=START_NS + DAY_NS))
    write(folder / "van_clean.mcap", record(VAN, range(MOMENTS), seed=SEED))
    write(folder / "van_wall.bag", record(VAN, range(MOMENTS), attack=WALL, seed=SEED, start_ns=START_NS + DAY_NS))
    return folder


@pytest.fixture(scope="module")
def audited(calibrated: Path, fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store in which the fleet was scanned."""
    store = tmp_path_factory.mktemp("audited") / "audit"
    shutil.copytree(calibrated, store)
    assert run(["scan", str(fleet), "--store", str(store)]) == Exit.FINDINGS
    return store


@pytest.fixture
def verbs(audited: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> Audit:
    return Audit(audited, capfdbinary.readouterr)


def test_what_was_recorded_in_each_container_is_clean_or_attacked(verbs: Audit):
    rows = {row["name"]: row for row in verbs("query", "summary", "--format", "json").rows}
    attacked = {"wagon_clean.db3": [], "wagon_spot.mcap": [1], "van_clean.mcap": [], "van_wall.bag": [0]}
    assert {name: rows[name]["attacked_sensors"] for name in attacked} == attacked
    clean = {True: MOMENTS, False: SPOT.moments.start}
    assert {name: rows[name]["clean"] for name in attacked} == {
        name: clean[not named] for name, named in attacked.items()
    }


@pytest.mark.parametrize("form", ["table", "parquet"])
def test_scan_names_what_was_attacked_in_every_format(form: str, verbs: Audit, fleet: Path):
    answer = verbs("scan", fleet / "wagon_spot.mcap", "--format", form)
    assert answer.code == Exit.FINDINGS
    assert all(text in answer.out for text in (b"wagon_spot.mcap", b"S_1"))


@pytest.mark.parametrize(
    ("name", "form"), [("wagon_clean.db3", "table"), ("wagon_spot.mcap", "json"), ("van_wall.bag", "json")]
)
def test_inspect_gives_a_whole_recording_exit_code_0(name: str, form: str, verbs: Audit, fleet: Path):
    answer = verbs("inspect", fleet / name, "--format", form, store=False)
    assert answer.code == Exit.CLEAN
    assert "/lidar_top/points" in answer.out.decode()


def test_convert_writes_a_recording_that_is_judged_alike(fleet: Path, audit: Audit, tmp_path: Path):
    assert audit("convert", fleet / "van_wall.bag", tmp_path / "converted.mcap", store=False).code == Exit.CLEAN
    assert audit.scan(tmp_path / "converted.mcap").code == Exit.FINDINGS


def test_attack_writes_a_recording_in_which_the_attack_is_found(fleet: Path, audit: Audit, tmp_path: Path):
    attacked = tmp_path / "attacked.mcap"
    assert audit("attack", fleet / "wagon_clean.db3", attacked, "--on", "S_0", store=False).code == Exit.CLEAN
    assert audit.scan(attacked).code == Exit.FINDINGS


REFUSED: dict[str, Callable[[Path], list[object]]] = {
    "demo": lambda fleet: [fleet],
    "weights": lambda fleet: ["inspect", fleet / "van_clean.mcap"],
    "train-matcher": lambda fleet: [fleet / "van_clean.mcap"],
}
"""What a verb is given that it must refuse: a demo that would write among recordings, weights that are none."""


@pytest.mark.parametrize("verb", REFUSED)
def test_what_a_verb_cannot_do_is_said_in_one_line(verb: str, fleet: Path, verbs: Audit):
    answer = verbs(verb, *REFUSED[verb](fleet), store=False)
    assert answer.code == Exit.FAILED
    assert len((answer.err.strip() or answer.out.decode()).splitlines()) <= 10

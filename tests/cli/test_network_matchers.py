"""Networks as matchers from the command line: their cost is printed, and the store says what they ran on."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

torch = pytest.importorskip("torch")

from auditor.cli import auditor  # noqa: E402
from auditor.lab.evaluation import EvaluateTask, RecordingSource, evaluate_source, runner  # noqa: E402
from auditor.measurement.disparity.matchers import MatcherOptions  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet import weights as shipped  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import load_weights  # noqa: E402
from auditor.store.queries import run_sql  # noqa: E402
from auditor.store.store import Store  # noqa: E402
from tests.making.preloaded import network_preloaded  # noqa: E402
from tests.making.psmnet_networks import ruled_state  # noqa: E402
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive  # noqa: E402

SMALL = (192, 64)
"""What a network takes for a picture grows with its size."""


@pytest.fixture(scope="module", autouse=True)
def _preloaded() -> Iterator[None]:
    with network_preloaded():
        yield


@pytest.fixture(autouse=True)
def one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads that wait for one another on a busy machine cost seconds."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "clean.mcap", 3, positions_m=THREE_CAMERAS, size_px=SMALL)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "tiny.pt"
    described = {"align_corners": True, "max_disparity": 64, "step": 2, "colour": False}
    torch.save({"state_dict": ruled_state(2), "psmnet": described}, path)
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(auditor, [str(argument) for argument in arguments], standalone_mode=False)


def versions(store: Path) -> dict[str, dict[str, str]]:
    rows = run_sql(Store.open(store), "SELECT matcher, versions FROM measurements").to_pylist()
    return {row["matcher"]: dict(row["versions"]) for row in rows}


def test_a_scan_tells_the_cost_first_and_keeps_the_version_of_torch(drive: Path, weights: Path, tmp_path: Path) -> None:
    store = tmp_path / "audit"
    for matcher in (("sgbm",), ("psmnet", "--weights", weights)):
        done = run("scan", drive, "--measure-only", "--store", store, "--jobs", 1, "--matcher", *matcher)
        assert done.exception is None, done.stderr
        assert ("psmnet on cpu" in done.stderr) == (matcher[0] == "psmnet")
    assert "s for 3 frames" in done.stderr
    assert "off scale" in done.stderr  # untrained as it is
    found = versions(store)
    assert found["psmnet"]["torch"] == torch.__version__
    assert "torch" not in found["sgbm"]


def test_a_network_without_a_file_of_weights_names_the_attacked_camera(tmp_path: Path) -> None:
    small = {"count": 1, "positions_m": THREE_CAMERAS, "size_px": SMALL}
    clean = write_drive(tmp_path / "clean.mcap", **small)
    start_ns = START_NS + DAY_NS
    attacked = write_drive(tmp_path / "attacked.mcap", **small, seed=50, start_ns=start_ns, attacked={2: range(1)})
    store = tmp_path / "audit"
    network = ("--matcher", "psmnet", "--max-disparity", 64, "--jobs", 1, "--store", store)
    assert run("calibrate", clean, *network).exception is None
    scanned = run("scan", attacked, *network, "--pictures", "none", "--format", "json")
    assert scanned.exception is None, scanned.stderr
    kept = Store.open(store)
    found = run_sql(kept, "SELECT frame, attacked FROM verdicts WHERE kind = 'attacked' ORDER BY frame").to_pylist()
    assert [(row["frame"], row["attacked"]) for row in found] == [(0, [2])]
    settings = {row["settings"] for row in run_sql(kept, "SELECT settings FROM measurements").to_pylist()}
    [known] = settings
    assert load_weights(shipped.SHIPPED).sha256 in known


def test_help_and_import_load_no_torch() -> None:
    code = "import sys, auditor\nfrom auditor.cli import run\nrun(['scan', '--help'])\nsys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, capture_output=True).returncode == 0


def test_an_evaluation_with_a_network_stands_beside_sgbms_and_goes_on_where_it_was(
    weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few cases are measured here: the command, which has processes of its own, would measure all."""
    pair, store = write_drive(tmp_path / "pair.mcap", 1, positions_m=(0.6, 0.0), size_px=SMALL), tmp_path / "evaluation"
    few = [
        replace(one, cases=lambda *drawn, cases=one.cases: islice(cases(*drawn), None, None, 9))
        for one in runner.experiments_of(())
    ]
    with monkeypatch.context() as patched:
        patched.setattr(runner, "experiments_of", lambda _: few)
        for matcher in ({}, {"matcher": "psmnet", "network": MatcherOptions(weights=weights)}):
            assert evaluate_source(EvaluateTask(RecordingSource(pair), store, **matcher), lambda *_: None).fresh
    again = run(
        *("evaluate", pair, "--store", store, "--format", "json", "--jobs", 1),
        *("--matcher", "psmnet", "--weights", weights),
    )
    assert again.exception is None, again.stderr
    assert "measured before" in again.stderr
    assert {row["matcher"] for row in json.loads(again.stdout)} == {"sgbm", "psmnet"}
    found = run_sql(Store.open(store), "SELECT DISTINCT matcher, versions FROM evaluations").to_pylist()
    assert {row["matcher"]: "torch" in dict(row["versions"]) for row in found} == {"sgbm": False, "psmnet": True}

"""Bad input ends in one clear line and the right exit code, and spoils nothing else."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from auditor.cli import run
from tests.making.audits import ask
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drives") / "clean.mcap", count=8, positions_m=THREE_CAMERAS)


@pytest.fixture(scope="module")
def calibrated(clean: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with thresholds."""
    store = tmp_path_factory.mktemp("calibrated") / "audit"
    assert run(["calibrate", str(clean), "--store", str(store)]) == 0
    return store


@pytest.fixture
def store(calibrated: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Path:
    """A store of the test's own with thresholds, and nothing printed yet."""
    capfd.readouterr()
    return shutil.copytree(calibrated, tmp_path / "audit")


def remarks(capfd: pytest.CaptureFixture[str]) -> list[str]:
    """The lines on stderr that are no progress."""
    return [line for line in capfd.readouterr().err.splitlines() if line.startswith("auditor: ")]


def scan(store: Path, *arguments: object) -> int:
    return run(["scan", "--jobs", "1", "--store", str(store), *map(str, arguments)])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: path, "no such file or folder"),
        (lambda path: path.touch() or path, "empty"),
        (lambda path: path.mkdir() or path, "no recording"),
        (lambda path: path.write_bytes(b"not a recording" * 100) and path, ""),
    ],
    ids=["missing", "empty", "folder", "other"],
)
def test_what_is_no_recording_is_named_and_the_others_go_on(
    make, says: str, clean: Path, store: Path, tmp_path: Path, capfd
) -> None:
    bad = make(tmp_path / "bad.mcap")
    assert scan(store, bad) == 2
    [line] = remarks(capfd)
    assert "bad.mcap" in line
    assert says in line.lower()
    assert ";" in line, "it says what to do"
    assert scan(store, bad, clean) == 3
    assert "clean.mcap" in capfd.readouterr().out


def test_a_recording_without_three_overlapping_sensors_says_what_is_missing(store: Path, tmp_path: Path, capfd) -> None:
    two = write_drive(tmp_path / "two.mcap", count=3, positions_m=(0.6, 0.0), lidar=False)
    assert scan(store, two) == 3
    [line] = remarks(capfd)
    assert "two.mcap" in line
    assert "no triple possible: 2 cameras look the same way (camera_1, camera_2), and no LiDAR" in line
    assert run(["inspect", str(two)]) == 3
    assert "add a third camera, or a LiDAR" in capfd.readouterr().out


def test_a_rig_file_that_names_other_topics_is_refused_with_their_names(
    clean: Path, store: Path, tmp_path: Path, capfd
) -> None:
    rig = tmp_path / "rig.toml"
    assert run(["inspect", str(clean), "--write-rig", str(rig)]) == 0
    rig.write_text(rig.read_text().replace("/camera_2", "/elsewhere"))
    assert scan(store, clean, "--rig", rig) == 3
    [line] = remarks(capfd)
    assert "/elsewhere" in line


def test_thresholds_of_another_rig_kind_are_refused_without_transfer(
    clean: Path, store: Path, tmp_path: Path, capfd
) -> None:
    positions_m = (0.9, 0.7, 0.4, 0.0)
    other = write_drive(tmp_path / "other.mcap", count=6, positions_m=positions_m, start_ns=START_NS + DAY_NS)
    thresholds = tmp_path / "thresholds.parquet"
    assert run(["calibrate", str(clean), "--store", str(store), "--out", str(thresholds)]) == 0
    assert scan(store, other, "--calibration", thresholds) == 2
    assert "another rig kind" in capfd.readouterr().err
    assert scan(store, other, "--calibration", thresholds, "--transfer") in (0, 1)
    assert ask(store, "SELECT DISTINCT name FROM judgements JOIN measurements USING (measurement_id) WHERE transferred")


def test_thresholds_of_another_matcher_are_refused(clean: Path, store: Path, capfd) -> None:
    calibration = next((store / "calibrations").iterdir()).stem
    assert scan(store, clean, "--matcher", "sgbm-full", "--calibration", calibration) == 2
    assert "matcher sgbm, not sgbm-full" in capfd.readouterr().err


def test_a_thresholds_file_that_is_none_is_refused(clean: Path, store: Path, tmp_path: Path, capfd) -> None:
    for name, content in (("text.parquet", b"theta = 0.1"), ("empty.parquet", b"")):
        (tmp_path / name).write_bytes(content)
        assert scan(store, clean, "--calibration", tmp_path / name) == 2
        [line] = remarks(capfd)
        assert name in line
        assert "auditor calibrate" in line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["scan", "--matcher", "magic"], "no matcher is called 'magic'"),
        (["scan", "-r", "1.5"], "not between 0 and 1"),
        (["scan", "-r", "often"], "write it as 0.01 or 1%"),
        (["scan", "--incidents-per-hour", "inf"], "'inf' is not a number"),
        (["scan", "--incidents-per-hour", "nan"], "'nan' is not a number"),
        (["scan", "--min-coverage", "nan"], "'nan' is not a number"),
        (["scan", "--incidents-per-hour", "1", "--method", "paper"], "leave it away"),
        (["calibrate", "--frames", "20"], "is not a range of frames"),
        (["calibrate", "--frames", "900:901"], "no disparity errors"),
    ],
)
def test_an_option_without_sense_is_refused_before_any_work(
    arguments: list[str], says: str, clean: Path, tmp_path: Path, capfd
) -> None:
    verb, *options = arguments
    assert run([verb, str(clean), "--store", str(tmp_path / "audit"), *options]) == 2
    assert says in capfd.readouterr().err
    assert verb != "scan" or not (tmp_path / "audit").exists()


def test_a_folder_that_is_no_store_is_left_alone(clean: Path, tmp_path: Path, capfd) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert scan(tmp_path, clean) == 2
    assert "no store" in remarks(capfd)[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_judging_and_asking_need_a_store(tmp_path: Path, capfd) -> None:
    for command in (
        ["judge", str(tmp_path / "none")],
        ["query", "summary", "--store", str(tmp_path / "none")],
        ["report", "--store", str(tmp_path / "none")],
    ):
        assert run(command) == 2
        [line] = remarks(capfd)
        assert "there is no store" in line


def test_an_unknown_query_and_a_bad_parameter_are_refused(store: Path, capfd) -> None:
    for command, says in (
        (["query", "weather"], "no such query"),
        (["query", "incidents", "gap_s=long"], "gap_s"),
        (["query", "incidents", "gap"], "name=value"),
        (["query", "--sql", "COPY recordings TO 'x.csv'"], "SELECT"),
        (["query", "--sql", "SELECT * FROM read_text('/etc/hostname')"], "auditor query"),
    ):
        assert run([*command, "--store", str(store)]) == 2
        assert says in capfd.readouterr().err


def test_attacking_a_sensor_that_is_not_there_writes_nothing(clean: Path, tmp_path: Path, capfd) -> None:
    target = tmp_path / "attacked.mcap"
    assert run(["attack", str(clean), str(target), "--on", "S_9"]) == 2
    assert "no S_9" in remarks(capfd)[0]
    assert run(["attack", str(clean), str(clean), "--on", "S_1"]) == 2
    assert "exists already" in remarks(capfd)[0]
    assert run(["attack", str(clean), str(target), "--on", "S_0", "--kind", "wall", "--range", "9"]) == 2
    assert "only a ghost has a range" in remarks(capfd)[0]
    assert not target.exists()


def test_a_full_disk_is_one_line_and_leaves_finished_tables_whole(clean: Path, store: Path, tmp_path: Path) -> None:
    """A file-size limit stands in for the full disk: writing past it fails in the same place."""
    before = {path: path.read_bytes() for path in store.rglob("*.parquet")}
    another = write_drive(
        tmp_path / "another.mcap", count=8, positions_m=THREE_CAMERAS, seed=5, start_ns=START_NS + DAY_NS
    )
    program = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000)); "
        "from auditor.cli import run; sys.exit(run(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "scan", str(another), "--store", str(store), "--jobs", "1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    [line] = [line for line in done.stderr.splitlines() if line.startswith("auditor: ")]
    assert str(store) in line
    assert {path: path.read_bytes() for path in before} == before
    assert scan(store, another) in (0, 1)


@pytest.fixture
def _heeds_ctrl_c() -> Iterator[None]:
    """What a shell starts in the background ignores Ctrl-C, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


SIGNALLED = """
import os, sys, time
from pathlib import Path
from auditor.cli import run
from auditor.pipeline import workers

frames, number, arguments = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
before, wait = set(frames.iterdir()), workers.wait_for

def send_and_wait(*pipes, **how):
    while set(frames.iterdir()) == before:
        time.sleep(0.01)
    os.killpg(0, number)
    return wait(*pipes, **how)

if __name__ == "__main__":
    workers.wait_for = send_and_wait
    sys.exit(run(arguments))
"""
"""Sends itself and its workers the signal when they have begun to write, and before it takes any result."""


@pytest.mark.usefixtures("_heeds_ctrl_c")
@pytest.mark.parametrize(
    ("sent", "jobs", "code", "says"),
    [
        (signal.SIGINT, "2", 130, "interrupted"),
        (signal.SIGTERM, "2", 143, "ended by SIGTERM"),
    ],
)
def test_ctrl_c_and_sigterm_are_one_line_and_the_next_run_goes_on(
    sent: signal.Signals,
    jobs: str,
    code: int,
    says: str,
    clean: Path,
    store: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "signalled.py").write_text(SIGNALLED)
    drive = {"count": 4, "positions_m": THREE_CAMERAS}
    long = [str(write_drive(tmp_path / f"long{day}.mcap", **drive, start_ns=START_NS + day * DAY_NS)) for day in (1, 2)]
    scanning = ["scan", *long, "--pictures", "none", "--store", str(store), "--jobs", jobs]
    signalled = [sys.executable, str(tmp_path / "signalled.py"), str(store / "frames"), str(int(sent)), *scanning]
    with subprocess.Popen(signalled, stderr=subprocess.PIPE, text=True, start_new_session=True) as started:
        _, errors = started.communicate()
    assert started.returncode == code, errors
    assert len(errors.strip().splitlines()) == 1, errors
    assert says in errors
    deadline = time.monotonic() + 300  # which only a failing test waits for
    while _lives(started.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _lives(started.pid), "no worker is left"
    capfd.readouterr()
    again, errors = run(scanning), capfd.readouterr().err
    assert again in (0, 1), errors
    assert "4 frames" in errors


def _lives(session: int) -> bool:
    """True while a process of the session is there; one that has ended may be, until it is reaped."""
    try:
        os.killpg(session, 0)
    except ProcessLookupError:
        return False
    return True


def test_an_unforeseen_error_ends_in_2_and_not_in_the_code_of_findings(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def defect(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("auditor.cli.auditor.main", defect)
    assert run(["scan"]) == 2
    message = capfd.readouterr().err
    assert "ZeroDivisionError" in message
    assert message.rstrip().endswith("please report the lines above")


@pytest.mark.parametrize("arguments", [["inspect"], ["calibrate"], ["convert"]])
def test_sigterm_ends_a_verb_that_works_in_its_own_process(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The signal comes while that process works; the handler of before is back afterwards."""

    def kill(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("auditor.pipeline.workers.wait_for", kill)
    monkeypatch.chdir(tmp_path)
    before = signal.getsignal(signal.SIGTERM)
    drive = write_drive(tmp_path / "drive.mcap", count=2)
    target = [str(tmp_path / "copy.mcap")] if arguments == ["convert"] else []
    assert run([arguments[0], str(drive), *target, *arguments[1:]]) == 143
    [line] = capfd.readouterr().err.splitlines()
    kept = "; finished recordings are kept, run the same command again to go on" if arguments == ["calibrate"] else ""
    assert line == f"auditor: ended by SIGTERM{kept}"
    assert signal.getsignal(signal.SIGTERM) is before

"""From recordings and streets to a network: what is known of a sample is true, and a killed training goes on."""

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("torch")

from auditor.cli import auditor
from auditor.errors import RecordingError, SettingError
from auditor.lab.simulation.drives import make_drive
from auditor.lab.training import (
    RecordingSamples,
    SampleFiles,
    SampleTask,
    StreetSamples,
    checkpoints,
    make_samples,
    training_set,
)
from auditor.lab.training.checkpoints import CurvePoint
from auditor.lab.training.samples import dense_sample, lidar_sample, pair_of, score
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import MatcherOptions, SgbmMatcher, find_matcher
from auditor.measurement.disparity.rectification import rectification
from auditor.model.rig import LIDAR
from auditor.model.verdict import AttackLabel
from auditor.recordings import write_mcap
from tests.making.preloaded import network_preloaded
from tests.making.scenes import FOCAL, moved, plane_frame, plane_rig
from tests.making.small_drives import drive_frames, write_drive

THREE = (0.6, 0.3, 0.0)
TINY = ["--width", "2", "--max-disparity", "64", "--crop", "32", "64", "--batch", "2", "--jobs", "1", "--frames", "3"]


class KilledError(BaseException):
    """Stands for a killed process: nothing catches it."""


def progress(what: str, done: int) -> None:
    pass


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("drives")
    return tuple(write_drive(folder / f"{n}.mcap", 9, positions_m=THREE, seed=n) for n in (1, 2))


def test_a_lidars_points_are_the_disparities_of_a_pair_that_a_scan_matches() -> None:
    rig = plane_rig(THREE)
    left, right, disparity = lidar_sample(plane_frame(rig, depth_m=9.0), rig)
    i, k = pair_of(0, rig)
    known = disparity[~np.isnan(disparity)]
    assert known.size > 1000
    assert np.abs(known - FOCAL * rig.baseline_m(i, k) / 9.0).max() < 0.01
    assert np.isnan(disparity[:, : int(known[0])]).all()  # their matches lie outside the other image
    assert score(SgbmMatcher(), [(left, right, disparity)]).over_3px_share < 0.05
    assert lidar_sample(plane_frame(rig, without=frozenset({LIDAR})), rig) is None


def test_of_cameras_beside_the_line_a_sample_is_a_pair_in_its_own_view_and_only_what_both_see() -> None:
    drive = make_drive(3, 1, width_px=620, height_px=188)
    rig = moved(drive.rig, ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0)))
    frame = replace(drive, vehicle=replace(drive.vehicle, rig=rig)).frame(0)
    left, right, disparity = lidar_sample(frame, rig)
    assert left.shape == right.shape == disparity.shape
    valid_masks = rectification(rig).pairs[pair_of(0, rig)].valid_masks
    assert 0.5 < np.mean(valid_masks[2]) < 0.95
    assert np.isnan(disparity[~valid_masks[2]]).all()
    assert np.count_nonzero(~np.isnan(disparity)) > 10_000
    assert score(SgbmMatcher(), [(left, right, disparity)]).over_3px_share < 0.2  # of enlarged pictures


def test_a_street_knows_the_disparity_of_every_pixel_and_its_lidar_agrees() -> None:
    drive = make_drive(3, 4, width_px=620, height_px=188)
    left, right, disparity = dense_sample(drive, 3)
    row, column = np.nonzero(~np.isnan(disparity))
    match = np.rint(column - disparity[row, column]).astype(int)
    aligned = np.median(np.abs(left[row, column].astype(int) - right[row, match]))
    assert aligned < 0.5 * np.median(np.abs(left[row, column].astype(int) - right[row, column]))
    i, k = pair_of(3, drive.rig)
    view = lidar_view(drive.cloud(3), drive.rig, k)
    assert np.nanmedian(np.abs(view.disparity_px(i) - disparity[view.row, view.column])) < 0.5
    assert {pair_of(number, drive.rig) for number in range(9)} == {(1, 2), (1, 3), (2, 3)}


def test_samples_are_made_once_and_spread_over_the_recording(drives: tuple[Path, Path], tmp_path: Path) -> None:
    made = make_samples(SampleTask(RecordingSamples(drives[0]), tmp_path, 100), progress)
    assert made.fresh
    assert len(made.files) == 9
    assert not make_samples(SampleTask(RecordingSamples(drives[0]), tmp_path, 100), progress).fresh
    few = make_samples(SampleTask(RecordingSamples(drives[0]), tmp_path, 3), progress)
    numbers = [int(file.stem) for file in few.files]
    assert 2 <= len(numbers) <= 3
    assert len({b - a for a, b in pairwise(numbers)}) == 1
    samples = SampleFiles(made.files)
    assert [len(samples), len(samples[1:3])] == [9, 2]
    left, right, disparity = samples[0]
    assert left.shape == right.shape == disparity.shape
    with RecordingSamples(drives[0]).open() as source:
        _, exact = next(source.numbered)
    assert np.nanmax(np.abs(exact[2] - disparity)) <= 1 / 128 + 1e-6
    made.files[0].write_bytes(b"torn")
    with pytest.raises(SettingError, match="not a readable sample"):
        samples[0]


def test_attacked_recordings_and_those_without_a_lidar_are_refused(tmp_path: Path) -> None:
    rig = plane_rig(THREE)
    attacked, blind = tmp_path / "attacked.mcap", tmp_path / "blind.mcap"
    write_mcap(attacked, rig, drive_frames(rig, 4), [AttackLabel(rig.topic(1), "facula", 0, 2**60, {})])
    write_drive(blind, 4, positions_m=THREE, lidar=False)
    for path, message in ((attacked, "labels of attacks"), (blind, "no LiDAR")):
        with pytest.raises(RecordingError, match=message):
            make_samples(SampleTask(RecordingSamples(path), tmp_path / "samples", 10), progress)


def test_validation_sources_are_not_trained_on(drives: tuple[Path, Path], tmp_path: Path) -> None:
    made = [
        make_samples(SampleTask(source, tmp_path, 4), progress)
        for source in (RecordingSamples(drives[0]), StreetSamples(1, 1))
    ]
    with pytest.raises(SettingError, match="the same recording"):
        training_set(made, made[:1])
    both = training_set(made[:1], made[1:])
    assert {kind: len(files) for kind, files in both.validation.items()} == {"streets": 1}
    assert both.known != training_set(made[1:], made[:1]).known


@pytest.fixture
def _preloaded() -> Iterator[None]:
    with network_preloaded():
        yield


@pytest.mark.usefixtures("_preloaded")
def test_a_killed_training_goes_on_and_ends_in_weights_with_all_their_settings(
    drives: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["train-matcher", str(drives[0]), "--validate", str(drives[1]), "--out", str(tmp_path / "net"), *TINY]
    arguments += ["--steps", "3", "--validate-every", "1"]
    curve = tmp_path / "net" / "curve.csv"

    def killed(
        points: Sequence[CurvePoint], path: Path, really: Callable[..., None] = checkpoints._write_curve
    ) -> None:
        really(points, path)
        if len(points) == 2:
            raise KilledError

    with monkeypatch.context() as patched:
        patched.setattr(checkpoints, "_write_curve", killed)
        with pytest.raises(KilledError):
            CliRunner().invoke(auditor, arguments)
    assert curve.read_text().count("\n") == 3

    done = CliRunner().invoke(auditor, arguments)
    assert done.exit_code == 0, done.stderr
    with curve.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == list(range(1, 4))
    assert {row["samples"] for row in rows} == {"recordings"}
    assert len({row["sgbm_over_3px_share"] for row in rows}) == 1
    weights = tmp_path / "net" / "psmnet.safetensors"
    assert done.stdout.splitlines()[-1] == f"auditor scan RECORDING... --matcher psmnet --weights {weights}"
    matcher = find_matcher("psmnet", MatcherOptions(weights=weights))
    assert (matcher.range_px, matcher.step, matcher.colour, matcher.width) == (64, 2, False, 2)

    again = CliRunner().invoke(auditor, arguments)
    assert (again.exit_code, again.stdout) == (0, done.stdout)


def test_the_command_refuses_missing_inputs_before_any_work(drives: tuple[Path, Path], tmp_path: Path) -> None:
    for arguments, message in (
        ([], "name recordings, or give --synthetic"),
        ([str(drives[0])], "give --validate"),
        (
            [str(drives[0]), "--synthetic", "1", "--steps", "-5", "--out", str(tmp_path / "net")],
            "--steps: training is not possible",
        ),
    ):
        refused = CliRunner().invoke(auditor, ["train-matcher", *arguments], standalone_mode=False)
        assert message in str(refused.exception)
    assert not (tmp_path / "net").exists()

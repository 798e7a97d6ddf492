"""An evaluation gives each attack the verdict that a scan gives a recording that is attacked alike."""

import os
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.lab.evaluation import experiments_of, runner
from auditor.model.rig import Rig
from auditor.recordings import write_mcap
from tests.benchmarks.real_drives import frames
from tests.making.attacked_copies import compare, same

FRAMES, ATTACKED = 3, 1
"""The frame attacked alone has one before and one after it."""

pytestmark = pytest.mark.skipif("AUDITOR_TEST_DATA" not in os.environ, reason="needs AUDITOR_TEST_DATA")


def one_of_each_kind(experiment):
    """The experiment on one frame or interval, but each kind of attack once on the LiDAR and once on a camera."""

    def cases(rig, draws, past):
        found = {}
        for case in experiment.cases(rig, draws, past):
            wanted = case.attacked in ((0,), (1,)) and (draws.frame == ATTACKED or experiment.together > 1)
            if wanted or not experiment.attacks:
                found[case.attacked, case.attack, case.strength in ("bright", "moving")] = case
        return iter(found.values())

    return replace(experiment, cases=cases)


@pytest.fixture
def few_attacks(monkeypatch):
    """The experiments that are tried, with few cases each."""
    pattern = next((Path(os.environ["AUDITOR_TEST_DATA"]) / "laser_patterns").rglob("*.png"))
    chosen = [one_of_each_kind(one) for one in experiments_of((pattern,)) if one.name != "sensitivity"]
    monkeypatch.setattr(runner, "experiments_of", lambda patterns: tuple(chosen))
    return chosen


def halved(rig, frames):
    """The rig and frames with half of the rows and columns: attacks are of as many pixels as they are of whole ones."""
    half = np.array([[0.5, 0, -0.25], [0, 0.5, -0.25], [0, 0, 1]])
    cameras = [
        replace(one, width_px=one.width_px // 2, height_px=one.height_px // 2, projection=half @ one.projection)
        for one in rig.cameras
    ]

    def smaller(number, image):
        size_px = cameras[number - 1].width_px, cameras[number - 1].height_px
        return replace(image, pixels=cv2.resize(image.pixels, size_px, interpolation=cv2.INTER_AREA))

    made = (replace(one, images={n: smaller(n, image) for n, image in one.images.items()}) for one in frames)
    return Rig(rig.lidar, tuple(cameras)), made


def test_an_evaluation_and_a_scan_say_the_same_of_every_kind_of_attack(tmp_path, few_attacks):
    paths = []
    for number in ("0009", "0001"):
        rig, stream = frames(number, colour=True)
        paths.append(tmp_path / f"{number}.mcap")
        write_mcap(paths[-1], *halved(rig, islice(stream, FRAMES)), image="raw")
    found = list(compare(tmp_path, *paths, few_attacks, every=1, patterns=()))
    assert [one for one in found if not same(one.evaluated, one.scanned)] == []
    assert {one.experiment for one in found} == {"combinations", "further", "intervals", "patterns"}
    assert {one.evaluated.kind for one in found} >= {"attacked", "suspect"}
    assert {one.evaluated.finding for one in found} >= {"attacked", None}

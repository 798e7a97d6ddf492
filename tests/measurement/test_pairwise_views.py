"""Cameras that do not stand on one line: every pair is matched in its own view, and the whole rig is measured."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from auditor.errors import RigError
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.training.samples import lidar_sample
from auditor.measurement import FaultFeatures, draw, localise, measure, measure_stream
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.disparity.rectification import rectification
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame, Presence, SensorState
from auditor.model.measurement import Statistic
from auditor.model.optics.common_view import common_view
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import LIDAR, Rig
from tests.making.matchers import WholeRange
from tests.making.perturbed_rigs import perturbed
from tests.making.scenes import moved

ONE_ABOVE_ONE_AHEAD = ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0))
ON_THE_LINE = ((0.0, 0.0, 0.0),) * 3
BENT = (Lens("plumb_bob", (-0.2, 0.05, 0.001, 0.0)), Lens("equidistant", (0.01, 0.0, 0.0, 0.0)), NO_LENS)
SMALL = {"width_px": 414, "height_px": 126}


def through(drive: SyntheticDrive, rig: Rig) -> SyntheticDrive:
    return replace(drive, vehicle=replace(drive.vehicle, rig=rig))


def beside(seed: int, frames: int, offsets_m=ONE_ABOVE_ONE_AHEAD, **size: int) -> SyntheticDrive:
    drive = make_drive(seed, frames, **size)
    return through(drive, moved(drive.rig, offsets_m))


def without(frame: Frame, *missing: int) -> Frame:
    presence = {**frame.presence, **{sensor: Presence(SensorState.MISSING) for sensor in missing}}
    images = {number: image for number, image in frame.images.items() if number not in missing}
    return replace(frame, presence=presence, images=images, cloud=None if LIDAR in missing else frame.cloud)


@pytest.fixture(scope="module")
def bent() -> SyntheticDrive:
    drive = make_drive(2, 2, **SMALL)
    return through(drive, moved(perturbed(drive.rig, BENT, 2), ONE_ABOVE_ONE_AHEAD))


def test_cameras_on_one_line_share_a_view_and_others_have_one_for_each_pair_matched() -> None:
    rig = make_drive(2, 1, **SMALL).rig
    assert not rectification(moved(rig, ON_THE_LINE)).pairs
    off = rectification(moved(rig, ONE_ABOVE_ONE_AHEAD))
    assert list(off.pairs) == [(1, 3), (2, 3), (1, 2)]
    for pair in off.pairs.values():
        assert pair.seen.rig.is_rectified
        # The line of S_1 and S_2, 7 cm apart of which S_2 stands 15 cm ahead, points far from where the cameras look.
        least = 0.3 if pair.cameras == (1, 2) else 0.5
        assert all(mask.mean() > least for mask in pair.valid_masks.values())


def test_a_camera_far_ahead_of_its_neighbour_is_measured_without_the_pair_of_the_two() -> None:
    drive = beside(2, 1, ((0.0, 0.0, 3.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.0)), **SMALL)
    rig, frame = drive.rig, drive.frame(0)
    with pytest.raises(RigError, match="no view in common"):
        common_view(rig.pair(1, 2), widest=True)
    measured, evidence = measure(frame, rig, SgbmMatcher())
    *usual, fallback = measured.counts
    assert None not in usual
    assert fallback is None
    assert FaultFeatures().update(evidence).keys() == {(1, 3), (2, 3)}
    assert AttackedFrame(frame, rig, SgbmMatcher()).counts({}, rig.measured_triples) == measured.counts
    assert lidar_sample(replace(frame, number=rig.pairs.index((1, 2))), rig) is None


def test_a_street_measures_like_the_same_street_along_one_line() -> None:
    apart = []
    for seed in (2, 3):
        E = {}
        for name, offsets in (("line", ON_THE_LINE), ("beside", ONE_ABOVE_ONE_AHEAD)):
            drive = beside(seed, 1, offsets, width_px=1242, height_px=375)
            counts = [measure(frame, drive.rig, SgbmMatcher())[0].counts for frame in drive.frames()]
            assert all(c is not None and c.gated_valid_px > 500 for row in counts for c in row)
            # Neighbours of which one stands ahead see little in common in a view along their own line: the fallback's
            # few pixels are measured, but say nothing of a mean.
            counts = [row[: len(drive.rig.triples)] for row in counts]
            assert all(c.gated_valid_px > 2000 for row in counts for c in row)
            E[name] = np.mean([[[c.disparity_error(s) for s in Statistic] for c in row] for row in counts], axis=(0, 1))
        apart.append(E["beside"] - E["line"])
    print("mean E, all and gated, beside the line less along it:", np.round(apart, 4).tolist())
    assert np.abs(np.mean(apart, axis=0)).max() < 0.02


def cases() -> Iterator[dict[int, object]]:
    facula = Facula(510.0, 60.0, 220.0, 70.0)
    yield {}
    for camera in (1, 2, 3):
        yield {camera: facula}
    yield {LIDAR: BogusWall(8.0, 0.0)}
    yield {LIDAR: BogusWall(8.0, 0.0), 2: facula}


@pytest.mark.parametrize("missing", [(), (LIDAR,), (1,)])
def test_a_bench_gives_what_measuring_the_attacked_frame_gives(bent: SyntheticDrive, missing: tuple[int, ...]) -> None:
    rig, matcher = bent.rig, SgbmMatcher()
    frame = without(bent.frame(0), *missing)
    attacked_frame = AttackedFrame(frame, rig, matcher)
    for attacks in cases():
        if set(attacks) & set(missing):
            continue
        images = {n: attacks[n].apply(image) if n in attacks else image for n, image in frame.images.items()}
        cloud = attacks[LIDAR].apply(frame.cloud, rig) if LIDAR in attacks else frame.cloud
        measured, _ = measure(replace(frame, images=images, cloud=cloud), rig, matcher)
        assert attacked_frame.counts(attacks) == measured.counts
        statistics = sensor_statistics(rig_sensor_checks(rig), measured.cells, measured.shares)
        assert attacked_frame.statistics(attacks) == statistics


class Pairing(SgbmMatcher):
    pairs_at_once = 8

    def __init__(self) -> None:
        super().__init__()
        self.pairs_matched: list[int] = []

    def match_pairs(self, images, pairs):
        self.pairs_matched.append(len(pairs))
        return [self.match(images[left], images[right]) for left, right in pairs]


def test_a_matcher_of_many_pairs_sees_those_of_several_frames_at_once(bent: SyntheticDrive) -> None:
    frames, matcher = [without(bent.frame(0)), without(bent.frame(1), LIDAR)], Pairing()
    plain = [measure(frame, bent.rig, WholeRange())[0] for frame in frames]
    streamed = [item[0] for item in measure_stream(frames, bent.rig, matcher)]
    assert [m.counts for m in streamed] == [m.counts for m in plain]
    assert matcher.pairs_matched == [3 + 2]  # without a LiDAR the pair (S_1, S_2) is in no triple
    attacked_frame = AttackedFrame(frames[0], bent.rig, matcher)
    attacked_frame.match_together(list(cases()))
    before = sum(matcher.pairs_matched)
    assert attacked_frame.counts({}) == plain[0].counts
    assert sum(matcher.pairs_matched) == before


def test_without_a_lidar_three_cameras_are_compared(bent: SyntheticDrive) -> None:
    rig = Rig(None, bent.rig.cameras)
    frame = without(bent.frame(0), LIDAR)
    measured, evidence = measure(frame, rig, SgbmMatcher())
    with_lidar, _ = measure(bent.frame(0), bent.rig, SgbmMatcher())
    assert measured.counts == (with_lidar.counts[2],)
    assert FaultFeatures().update(evidence).keys() == {(1, 3), (2, 3)}
    assert AttackedFrame(frame, rig, SgbmMatcher()).counts({}) == measured.counts


def test_a_facula_and_a_wall_are_found_in_the_reference_view_where_they_are() -> None:
    drive = beside(3, 1, width_px=1242, height_px=375)
    rig, frame = drive.rig, drive.frame(0)
    facula, wall = Facula(510.0, 120.0, 660.0, 180.0), BogusWall(7.0, 0.0)
    dazzled = replace(frame, images={**frame.images, 3: facula.apply(frame.images[3])})
    _, evidence = measure(dazzled, rig, SgbmMatcher())
    left, top, right, bottom = next(r.box_px for r in localise(evidence, rig.sensors, rig) if r.sensor == 3)
    cut = (rig.camera(3).intrinsics - evidence.rig.camera(3).intrinsics)[:2, 2]  # the reference view's own window
    assert (left + right) / 2 == pytest.approx(660 - cut[0], abs=50)
    assert (top + bottom) / 2 == pytest.approx(180 - cut[1], abs=50)
    assert draw(evidence, 0) is not None
    walls = []
    for one in (drive, through(drive, moved(drive.rig, tuple((-x, -y, -z) for x, y, z in ONE_ABOVE_ONE_AHEAD)))):
        walled = replace(one.frame(0), cloud=wall.apply(frame.cloud, one.rig))
        _, evidence = measure(walled, one.rig, SgbmMatcher())
        walls.append(next(r for r in localise(evidence, rig.sensors, rig) if r.sensor == LIDAR))
    beside_line, on_line = walls
    assert beside_line.points == pytest.approx(on_line.points, rel=0.02)
    assert beside_line.solid.centre_m == pytest.approx(on_line.solid.centre_m, abs=0.05)
    assert beside_line.solid.size_m[2] < 0.2


def test_fault_features_are_those_of_the_pairs_own_views_and_a_pair_that_was_missing_begins_anew(
    bent: SyntheticDrive,
) -> None:
    watch = FaultFeatures()
    seen = [
        watch.update(measure(frame, bent.rig, SgbmMatcher())[1])
        for frame in (bent.frame(0), without(bent.frame(1), 1), bent.frame(1))
    ]
    every = {(1, 2), (1, 3), (2, 3)}
    assert [set(fault_features) for fault_features in seen] == [every, {(2, 3)}, every]
    assert seen[0][1, 3].rows.row_aligned > 0.45
    assert np.isnan(seen[2][1, 3].rows.lagged_i)
    assert not np.isnan(seen[2][2, 3].rows.lagged_i)

"""Real drives judged by thresholds of another vehicle: of a second production year, or with another LiDAR."""

from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from auditor.model.calibration import Marks
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig_kind import Similarity
from auditor.pipeline.judge import Criteria, prior_for
from auditor.pipeline.judged import Judge, JudgeResult, JudgeSettings
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.pipeline.remarks import marked
from auditor.recordings import find_rigs, open_recording, survey, synchronise, write_mcap
from auditor.store.queries import run_sql
from auditor.store.store import Store
from auditor.store.versions.history import put_first_in_force
from tests.making.calibrations import calibrate

RINGS = 64
"""Of KITTI's LiDAR; its files hold ring after ring, each once around from straight ahead."""


def every_other_ring(cloud: PointCloud) -> PointCloud:
    """The cloud of a KITTI drive without every second ring."""
    x, y, _ = cloud.xyz_m.T
    azimuth = np.mod(np.arctan2(y, x), 2 * np.pi)
    ring = np.cumsum(np.abs(np.diff(azimuth, prepend=azimuth[:1])) > np.pi)
    assert ring[-1] + 1 == RINGS
    return PointCloud(cloud.stamp_ns, np.ascontiguousarray(cloud.xyz_m[ring % 2 == 0]))


FRAMES = 2
R = Decimal("0.01")


def measured(path: Path, store: Path) -> str:
    return measure_recording(MeasureTask(path, store), lambda *_: None).measurement_ids[0]


def part_of(drive: Path, path: Path, frames: slice, *, thinned: bool = False) -> Path:
    """Some frames of a drive as an MCAP file, and those of a LiDAR of half the rings where it is `thinned`."""
    with open_recording(drive) as recording:
        surveyed = survey(recording)
        rig = find_rigs(surveyed)[0]

        def chosen() -> Iterator[Frame]:
            stream = (one for one in synchronise(recording, rig, surveyed, colour=True) if isinstance(one, Frame))
            for one in islice(stream, frames.start, frames.stop):
                yield replace(one, cloud=every_other_ring(one.cloud)) if thinned else one

        write_mcap(path, rig, chosen())
    return path


@pytest.fixture(scope="module")
def audit(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, dict[str, str]]:
    """A store with a calibration on some frames of drive 0009, and the measurements of others by name."""
    folder = tmp_path_factory.mktemp("others")
    drive = real_data / "kitti_raw_2011_09_26_drive_0009"
    recordings = {
        "calibrated": part_of(drive, folder / "calibrated.mcap", slice(0, FRAMES)),
        "another year": part_of(real_data / "kitti_odometry_04", folder / "odometry_04.mcap", slice(0, FRAMES)),
        "half the rings": part_of(drive, folder / "half.mcap", slice(FRAMES, 2 * FRAMES), thinned=True),
        "same vehicle": part_of(drive, folder / "same.mcap", slice(FRAMES, 2 * FRAMES)),
    }
    by_name = {name: measured(path, folder / "audit") for name, path in recordings.items()}
    store = Store.open(folder / "audit")
    put_first_in_force(store, calibrate([(store, by_name["calibrated"])]))
    return store, by_name


def judged(audit: tuple[Store, dict[str, str]], name: str) -> JudgeResult:
    store, by_name = audit
    return Judge(store, JudgeSettings(Criteria(R))).judge(by_name[name])


def verdicts(store: Store, measurement: str) -> list[dict]:
    sql = "SELECT kind, attacked, named, evidence, finding FROM verdicts WHERE measurement_id = '{}'"
    return run_sql(store, sql.format(measurement)).to_pylist()


def test_a_second_production_year_is_judged_without_a_switch_and_marked(audit) -> None:
    store, by_name = audit
    found = judged(audit, "another year")
    assert found.error is None
    assert found.judgement.marks == Marks(Similarity.SIMILAR)
    assert found.judgement.transferred
    said = "thresholds transferred from a similar rig kind: LiDAR + 4 cameras 1242x375 f=722px b=0.06,0.47,0.06m"
    assert said in found.warnings
    assert sum(found.judgement.counts.values()) == FRAMES
    assert not [row for row in verdicts(store, by_name["another year"]) if row["finding"]]
    row = run_sql(store, "SELECT * FROM judgements WHERE similarity = 'similar'").to_pylist()[0]
    assert (row["transferred"], row["in_sample"], row["other_lidar"]) == (True, False, False)


def test_a_lidar_of_half_the_rings_is_another_one_and_nobody_accuses_it(audit) -> None:
    store, by_name = audit
    found = judged(audit, "half the rings")
    assert found.judgement.marks == Marks(other_lidar=True)
    assert "another LiDAR than that of the thresholds, by its points in view" in found.warnings
    prior = prior_for(store, by_name["half the rings"], Criteria(R))
    assert prior is not None
    assert "another LiDAR than those of the prior, by its points in view" in marked(found.judgement, prior)
    rows = verdicts(store, by_name["half the rings"])
    assert len(rows) == FRAMES
    assert not [row for row in rows if 0 in (row["named"] or ()) or row["finding"]]
    judged(audit, "same vehicle")
    sql = """
        SELECT other_lidar, check_mean[position] AS mean, check_samples[position] AS samples
        FROM judgements JOIN measurements USING (measurement_id) JOIN sensor_checks USING (rig_id)
        WHERE measurement_id IN ('{}', '{}') AND check_name = 'isolated_points' ORDER BY ALL
    """.format(by_name["half the rings"], by_name["same vehicle"])
    rows = run_sql(store, sql).to_pylist()
    usual, sparser = ([row for row in rows if row["other_lidar"] is other] for other in (False, True))
    assert {row["samples"] for row in (*usual, *sparser)} == {FRAMES}
    assert all(0.8 < after["mean"] - before["mean"] < 1.6 for before, after in zip(usual, sparser, strict=True))


def test_the_same_vehicle_has_no_mark_and_the_calibrated_recording_is_in_sample(audit) -> None:
    assert judged(audit, "same vehicle").judgement.marks == Marks()
    found = judged(audit, "calibrated")
    assert found.judgement.marks == Marks(in_sample=True)
    assert "in sample: the calibration was made of it" in found.warnings

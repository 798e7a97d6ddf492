"""Recordings of a rig kind that nobody calibrated are judged by the prior; and what else a judgement says."""

import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.identification.transfer import OPENCV, OPENCV_CPU
from auditor.model.calibration import PRIOR, CleanFrames, Marks
from auditor.model.verdict import Method
from auditor.pipeline.judge import Criteria
from auditor.pipeline.judged import Judge, JudgeResult, JudgeSettings
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.store.calibrations import make_calibration, read_calibration, write_calibration
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from auditor.store.versions.history import put_first_in_force
from tests.making.calibrations import calibrate
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive

FRAMES = 12
R = Decimal("0.01")
BY_DEFAULT = Criteria(R)
ALONE = "judged by the prior alone: no clean drive of its rig kind was seen; calibrate on some"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("recordings")
    how = {
        "clean": {"positions_m": THREE_CAMERAS},
        "attacked": {
            "start_ns": START_NS + DAY_NS,
            "seed": 3,
            "positions_m": THREE_CAMERAS,
            "attacked": {2: range(4, 8)},
        },
        "another kind": {"start_ns": START_NS + 2 * DAY_NS, "seed": 5, "positions_m": (0.9, 0.5, 0.0)},
    }
    return {name: write_drive(folder / f"{name}.mcap", FRAMES, **of) for name, of in how.items()}


@pytest.fixture(scope="module")
def kept(recordings: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, Path]]:
    """Of each recording its measurement, and a store that has it and the clean one."""
    folder, found = tmp_path_factory.mktemp("kept"), {}
    for name, path in recordings.items():
        if name != "clean":
            shutil.copytree(folder / "clean", folder / name)
        known = measure_recording(MeasureTask(path, folder / name), lambda *_: None).measurement_ids[0]
        found[name] = known, folder / name
    return found


@pytest.fixture
def measured(kept: dict[str, tuple[str, Path]], tmp_path: Path) -> Callable[..., tuple[Store, str, str]]:
    """A store of the test's own with the measurements of the clean recording and of another one."""

    def put(name: str = "clean") -> tuple[Store, str, str]:
        store = Store.open(shutil.copytree(kept[name][1], tmp_path / "audit"))
        return store, kept["clean"][0], kept[name][0]

    return put


def judged(store: Store, measurement: str, criteria: Criteria = BY_DEFAULT, **settings: object) -> JudgeResult:
    return Judge(store, JudgeSettings(criteria, **settings)).judge(measurement)


def test_without_any_calibration_the_prior_judges_and_every_answer_says_so(measured) -> None:
    store, clean, attacked = measured("attacked")
    quiet, found = (judged(store, one) for one in (clean, attacked))
    assert ALONE in quiet.warnings
    assert ALONE in found.warnings
    assert (quiet.complete, quiet.found, quiet.gaps) == (True, False, ())
    assert found.found
    assert (found.judgement.calibration_id, found.judgement.drives) == (PRIOR, 0)
    assert found.judgement.marks == Marks()
    assert store.ids("calibrations") == []
    assert verify(store).problems == ()
    [row] = run_sql(store, f"SELECT * FROM judgements WHERE measurement_id = '{attacked}'").to_pylist()
    assert (row["calibration_id"], row["drives"], row["similarity"], row["in_sample"]) == (PRIOR, 0, "same", False)
    assert set(row["check_samples"]) == {0}
    rows = {row["name"]: row for row in run_query(store, "summary", {}).to_pylist()}
    assert rows["attacked.mcap"]["attacked_sensors"] == [2]


def test_where_the_store_has_thresholds_of_others_only_the_recording_is_not_fully_audited(measured) -> None:
    store, clean, other = measured("another kind")
    put_first_in_force(store, calibrate([(store, clean)]))
    found = judged(store, other)
    assert found.judgement.calibration_id == PRIOR
    assert ALONE in found.warnings
    assert (found.complete, found.gaps) == (False, ("no thresholds for its rig kind and matcher",))
    assert judged(store, clean).judgement.calibration_id != PRIOR


def test_the_paper_s_method_has_no_prior(measured) -> None:
    store, clean, _ = measured()
    found = judged(store, clean, Criteria(R, Method.PAPER))
    assert (found.judgement, found.complete) == (None, False)
    assert found.gaps == ("no thresholds for its rig kind and matcher",)


def test_the_prior_holds_for_the_matcher_that_it_was_fitted_on(measured, monkeypatch) -> None:
    store, clean, _ = measured()
    monkeypatch.setattr("auditor.pipeline.judge.has_prior", lambda _: False)
    assert judged(store, clean).judgement is None


def test_the_prior_gives_no_incident_rate_and_is_not_strict(measured) -> None:
    store, clean, _ = measured()
    criteria = Criteria(R, incidents_per_hour=1.0)
    assert (
        "too few clean frames for that incident rate: its limit is extrapolated"
        in judged(store, clean, criteria).warnings
    )
    error = judged(store, clean, replace(criteria, strict=True)).error
    assert error.what == "its thresholds are the prior alone: no clean drive of this rig kind was seen"


def test_a_calibration_keeps_what_its_counts_depend_on_and_judgements_tell_where_it_differs(measured, tmp_path) -> None:
    store, clean, attacked = measured("attacked")
    made = calibrate([(store, clean)])
    versions = store.measurement(clean).versions
    assert made.clean[0].versions == {name: versions[name] for name in (OPENCV, OPENCV_CPU)}
    assert judged(store, attacked, calibration=made).judgement.marks == Marks()

    content = {field.name: getattr(made.clean[0], field.name) for field in fields(CleanFrames)}
    elsewhere = CleanFrames(**{**content, "versions": {OPENCV: "4.0.0", OPENCV_CPU: "NEON"}})
    other = make_calibration(made.rig_kind, made.procedure, [elsewhere])
    assert other.calibration_id == made.calibration_id, "the same frames are the same calibration"
    write_calibration(other, tmp_path / "other.parquet")
    told = judged(store, attacked, calibration=read_calibration(tmp_path / "other.parquet"))
    cpu = " ".join(sorted({"NEON", *versions[OPENCV_CPU].split()}))
    differs = f"OpenCV {versions[OPENCV]}, not 4.0.0, another CPU ({cpu})"
    assert told.judgement.marks == Marks(measured_otherwise=differs)
    assert f"the calibration's counts may differ: {differs}" in told.warnings
    rows = run_sql(store, "SELECT measured_otherwise FROM judgements").to_pylist()
    assert {row["measured_otherwise"] for row in rows} == {differs}


def test_a_recording_that_is_judged_by_itself_is_in_sample(measured) -> None:
    store, clean, attacked = measured("attacked")
    put_first_in_force(store, calibrate([(store, clean)]))
    for criteria in (Criteria(R), Criteria(R, Method.PAPER)):
        assert "in sample: the calibration was made of it" in judged(store, clean, criteria).warnings
        assert not judged(store, attacked, criteria).judgement.marks.in_sample
    sql = "SELECT measurement_id, in_sample FROM judgements WHERE current"
    assert {row["measurement_id"]: row["in_sample"] for row in run_sql(store, sql).to_pylist()} == {
        clean: True,
        attacked: False,
    }

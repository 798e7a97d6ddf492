"""The functions of `import auditor`: what they return as values, and what they refuse before any work."""

from pathlib import Path

import pytest

import auditor
from tests.making.report_stores import add_recording, new_store

ATTACK = [((1,), 10, 19)]


@pytest.fixture
def store(tmp_path: Path) -> auditor.Store:
    return new_store(tmp_path)


def test_what_cannot_be_scanned_is_a_result_with_its_error(tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("no recording")
    missing, broken = auditor.scan(
        [tmp_path / "missing.mcap", tmp_path / "text.mcap"], store=tmp_path / "audit", jobs=1
    )
    assert missing.recording == str(tmp_path / "missing.mcap")
    assert isinstance(missing.error, auditor.RecordingError)
    assert isinstance(broken.error, auditor.AuditorError)
    assert [one.complete for one in (missing, broken)] == [False, False]
    assert [one.found for one in (missing, broken)] == [False, False]


@pytest.mark.parametrize("wrong", [{"method": "magic"}, {"r": "often"}, {"r": 2}, {"matcher": "magic"}])
def test_a_wrong_argument_is_refused_before_any_work(wrong: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(auditor.SettingError):
        auditor.scan(tmp_path, store=tmp_path / "audit", **wrong)
    assert not (tmp_path / "audit").exists()


@pytest.mark.parametrize("wrong", [{"method": "magic"}, {"r": "often"}, {"no_such_option": 1}])
def test_a_wrong_argument_is_refused_before_a_store_at_an_address_is_asked(wrong: dict[str, object]) -> None:
    with pytest.raises(auditor.SettingError):
        auditor.scan("s3://nowhere/drives/", store="s3://nowhere/audit", **wrong)
    with pytest.raises(auditor.SettingError):
        auditor.judge("s3://nowhere/audit", **wrong)


def test_an_unknown_calibration_is_refused_before_the_first_result(store: auditor.Store) -> None:
    add_recording(store)
    with pytest.raises(auditor.ThresholdsError):
        auditor.judge(store, calibration="zzz")
    with pytest.raises(auditor.ThresholdsError):
        auditor.scan("drive.mcap", store=store.folder, calibration="zzz")


def test_a_store_without_measurements_cannot_be_judged(store: auditor.Store) -> None:
    with pytest.raises(auditor.StoreError, match="nothing has been measured"):
        auditor.judge(store)


def test_judging_again_returns_a_judgement_for_each_measurement(store: auditor.Store) -> None:
    measurements = {add_recording(store, "a.mcap", attacks=ATTACK), add_recording(store, "b.mcap")}
    judged = {one.recording: one for one in auditor.judge(store, r=0, method="paper")}
    assert {one.measurement_id for one in judged.values()} == measurements
    assert (judged["a.mcap"].found, judged["b.mcap"].found) == (True, False)


def test_a_measurement_without_thresholds_is_neither_judged_nor_complete(store: auditor.Store) -> None:
    add_recording(store)
    for table in ("calibrations", "calibration_history"):
        for file in (store.folder / table).iterdir():
            file.unlink()
    [one] = auditor.judge(store)
    assert (one.judgement, one.error, one.complete) == (None, None, False)
    assert "the store has no thresholds" in one.warnings[0]


def test_a_store_s_recordings_with_incidents_are_left_out_of_a_calibration(store: auditor.Store) -> None:
    add_recording(store, "attacked.mcap", attacks=ATTACK, labelled=False)
    add_recording(store, "clean.mcap", labelled=False)
    made = auditor.calibrate(store.folder, store=store.folder)
    [sentence] = made.left_out
    assert sentence.startswith("attacked.mcap: left out: by its current verdicts")
    assert len(made.calibration.recordings) == 1
    assert made.errors == ()


@pytest.mark.parametrize("arguments", [((), {}), (("incidents",), {"sql": "SELECT 1"}), (("verdicts",), {})])
def test_a_query_needs_a_name_or_sql_and_a_view_is_not_a_query(
    arguments: tuple[tuple[str, ...], dict[str, str]], store: auditor.Store
) -> None:
    names, more = arguments
    with pytest.raises(auditor.QueryError):
        auditor.query(store, *names, **more)


def test_a_query_for_a_recording_that_is_not_there_is_an_error_and_not_an_empty_table(store: auditor.Store) -> None:
    add_recording(store)
    with pytest.raises(auditor.QueryError, match="no recording has the name"):
        auditor.query(store, "incidents", recording="nosuch")
    assert auditor.query(store, "incidents", recording="drive.mcap").num_rows == 0

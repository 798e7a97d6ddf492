"""Recordings of a batch that no calibration fits are judged by those that show nothing, never by themselves."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import pytest

from auditor.cli import run
from auditor.model.calibration import PRIOR
from auditor.model.settings import Criteria
from auditor.model.verdict import JudgedBy, Method
from auditor.pipeline.calibrations import batch
from auditor.pipeline.calibrations.batch import (
    FEWEST_CLEAN,
    MOST_GROUPS,
    calibrations_of_others,
    drives_of,
    judge_batch,
)
from auditor.pipeline.judged import JudgeResult, JudgeSettings
from auditor.store.maintenance.verify import verify
from auditor.store.records import GivenLabel
from auditor.store.store import Store
from auditor.store.versions.history import histories, put_first_in_force
from tests.making.calibrations import calibrate
from tests.making.fleets import FRAMES, RIG, add_drive
from tests.making.stores import add_measurement, make_measurement, make_rig

R = Decimal("0.01")
BY_DEFAULT = JudgeSettings(Criteria(R))
SCANNING = replace(BY_DEFAULT, only_stale=True)
ATTACKED = {"quay": (2,), "harbour": (0,)}
CLEAN = ("alder", "birch", "cedar", "elm")
ALONE = "judged by the prior alone: no clean drive of its rig kind was seen; calibrate on some"
BY_BATCH = "judged by {} other recordings of its rig kind that show nothing: provisional; calibrate on clean drives"

EARLIER = "earlier recordings of its rig kind were judged by the prior alone: auditor judge judges all by each other"


def drives(store: Store, names: tuple[str, ...], **how: object) -> dict[str, str]:
    """The measurements of drives of these names, a day apart."""
    return {
        name: add_drive(store, name, seed=number + 1, day=number, attacked=ATTACKED.get(name, ()), **how)
        for number, name in enumerate(names)
    }


def judged(store: Store, settings: JudgeSettings = BY_DEFAULT) -> dict[str, JudgeResult]:
    """What became of each recording of a store, by name."""
    return {one.recording: one for one in judge_batch(store, store.ids("measurements"), settings)}


def provenance(results: dict[str, JudgeResult]) -> dict[str, str | None]:
    return {name: one.by for name, one in results.items()}


def taught_by(store: Store, result: JudgeResult) -> tuple[str, ...]:
    """The recordings that the calibration of a recording was made of."""
    return store.calibration(result.judgement.calibration_id).recordings


@pytest.fixture
def store(tmp_path) -> Store:
    return Store.open(tmp_path / "audit", create=True)


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> tuple[Store, dict[str, str]]:
    store = Store.open(tmp_path_factory.mktemp("fleet") / "audit", create=True)
    return store, drives(store, (*CLEAN, *ATTACKED))


@pytest.fixture
def fleet(measured, store) -> dict[str, str]:
    """Six drives of one rig kind in the test's own store, two of them attacked."""
    kept, found = measured
    shutil.copytree(kept.folder, store.folder, dirs_exist_ok=True)
    return found


@pytest.fixture(scope="module")
def judged_once(measured, tmp_path_factory) -> tuple[Store, dict[str, str], dict[str, JudgeResult]]:
    """The fleet's store after a first scan, its measurements, and what became of each; tests do not change it."""
    kept, found = measured
    store = Store.open(shutil.copytree(kept.folder, tmp_path_factory.mktemp("judged") / "audit"))
    return store, found, judged(store, SCANNING)


@pytest.fixture
def judged_fleet(judged_once, store) -> dict[str, JudgeResult]:
    """What became of each in the test's own store, which was scanned once."""
    shutil.copytree(judged_once[0].folder, store.folder, dirs_exist_ok=True)
    return judged_once[2]


def test_recordings_are_judged_by_the_others_that_show_nothing(judged_once) -> None:
    store, fleet, results = judged_once
    assert set(provenance(results).values()) == {JudgedBy.BATCH}
    assert {name for name, one in results.items() if one.found} == set(ATTACKED)
    for name, one in results.items():
        recording_id = store.measurement(fleet[name]).recording_id
        taught = taught_by(store, one)
        assert recording_id not in taught
        assert not set(taught) & {store.measurement(fleet[attacked]).recording_id for attacked in ATTACKED}
        assert len(taught) == (4 if name in ATTACKED else 3)
        assert one.judgement.drives == len(taught)
        assert BY_BATCH.format(len(taught)) in one.warnings
        assert ALONE not in one.warnings
        assert (one.complete, one.gaps) == (True, ())
    assert store.current_judgements()[fleet["alder"]] == results["alder"].judgement


def test_what_a_batch_found_is_found_where_it_is_judged_alone_and_others_of_the_store_keep_their_verdicts(
    store, fleet, judged_fleet
) -> None:
    before = {known: one for known, one in store.current_judgements().items() if known != fleet["quay"]}
    [alone] = judge_batch(store, [fleet["quay"]], BY_DEFAULT)
    assert (alone.by, alone.found) == (JudgedBy.BATCH, True)
    assert len(taught_by(store, alone)) == len(CLEAN)
    assert {known: one for known, one in store.current_judgements().items() if known != fleet["quay"]} == before


def test_a_new_recording_is_judged_by_the_latest_others_of_the_store_that_show_nothing(
    store, fleet, judged_fleet, monkeypatch
) -> None:
    monkeypatch.setattr(batch, "MOST_OF_STORE", 4)
    rowan = add_drive(store, "rowan", seed=41, day=-1)
    [one] = judge_batch(store, [rowan], SCANNING)
    assert (one.by, one.found) == (JudgedBy.PRIOR, False), "of the three latest two were attacked"
    monkeypatch.setattr(batch, "MOST_OF_STORE", 7)
    [one] = judge_batch(store, [rowan], SCANNING)
    assert (one.by, one.found) == (JudgedBy.BATCH, False)
    taught = taught_by(store, one)
    assert len(taught) == len(CLEAN)
    assert not set(taught) & {store.measurement(fleet[name]).recording_id for name in ATTACKED}
    assert BY_BATCH.format(len(taught)) in one.warnings


def test_recordings_that_came_before_there_were_enough_are_said_to_be_judged_by_the_prior(store, capfd) -> None:
    added = drives(store, CLEAN)
    for name in CLEAN[:3]:
        [one] = judge_batch(store, [added[name]], SCANNING)
        assert one.by is JudgedBy.PRIOR
    [fourth] = judge_batch(store, [added["elm"]], SCANNING)
    assert (fourth.by, fourth.warnings[-1]) == (JudgedBy.BATCH, EARLIER)
    assert run(["judge", "--store", str(store.folder)]) in {0, 3}
    assert EARLIER not in capfd.readouterr().err
    verdicts = Store.open(store.folder).current_judgements().values()
    assert all(one.drives for one in verdicts), "the command it names judges them by each other"


def test_what_the_others_find_teaches_no_more(store, fleet, monkeypatch) -> None:
    """By the prior elm shows nothing, and an incident by the other recordings."""
    really, elm, passes = batch.judge_side_by_side, fleet["elm"], []

    def judge(*given: object) -> Iterator[JudgeResult]:
        passes.append(given)
        for one in really(*given):
            found = one.measurement_id == elm and one.by is JudgedBy.BATCH
            yield replace(one, judgement=replace(one.judgement, in_incidents=3)) if found else one

    monkeypatch.setattr(batch, "judge_side_by_side", judge)
    results = judged(store)
    assert len(passes) == 3  # by the prior, with elm, and without it
    of_elm = store.measurement(elm).recording_id
    assert all(of_elm not in taught_by(store, one) for one in results.values())
    assert {name: len(taught_by(store, one)) for name, one in results.items()} == {
        **dict.fromkeys(CLEAN, 2),
        **dict.fromkeys(("elm", *ATTACKED), 3),
    }


def test_calibrations_of_a_batch_are_kept_and_never_in_force(judged_once) -> None:
    store, _, results = judged_once
    assert histories(store) == []
    assert set(store.ids("calibrations")) == {one.judgement.calibration_id for one in results.values()}
    assert verify(store).problems == ()


def test_tables_and_json_say_by_what_each_was_judged(store, fleet, capfd) -> None:
    oak = add_drive(store, "oak", seed=50, rig=make_rig(4))
    assert run(["judge", "--store", str(store.folder), "--format", "json"]) == 1
    answers = capfd.readouterr()
    by = {row["measurement_id"]: row["by"] for row in json.loads(answers.out)["recordings"]}
    assert by == {**dict.fromkeys(fleet.values(), "batch"), oak: "prior"}
    assert BY_BATCH.format(4) in answers.err
    assert run(["judge", "--store", str(store.folder)]) == 1
    rows = [line.split() for line in capfd.readouterr().out.splitlines()]
    named = dict.fromkeys(fleet, "batch") | {"oak": "prior"}
    assert {row[0]: row[-1] for row in rows if row and row[0] in named} == named


def test_a_second_scan_keeps_the_verdicts(store, judged_fleet) -> None:
    first, second = judged_fleet, judged(store, SCANNING)
    assert {one.fresh for one in first.values()} == {True}
    assert {one.fresh for one in second.values()} == {False}
    assert {name: one.judgement for name, one in second.items()} == {n: one.judgement for n, one in first.items()}
    assert second["alder"].warnings == first["alder"].warnings


def test_a_new_drive_changes_what_the_others_are_judged_by(store, judged_fleet) -> None:
    first = judged_fleet
    add_drive(store, "fir", seed=40, day=40)
    second = judged(store, SCANNING)
    assert second["quay"].fresh
    assert second["quay"].judgement.calibration_id != first["quay"].judgement.calibration_id
    assert second["quay"].judgement.drives == 5


def test_three_recordings_stay_with_the_prior(store) -> None:
    drives(store, CLEAN[:3])
    results = judged(store)
    assert set(provenance(results).values()) == {JudgedBy.PRIOR}
    assert all(ALONE in one.warnings for one in results.values())
    assert store.ids("calibrations") == []


def test_two_clean_recordings_teach_nobody(store) -> None:
    drives(store, (*CLEAN[:2], *ATTACKED))
    results = judged(store)
    assert provenance(results) == dict.fromkeys(results, JudgedBy.PRIOR)
    assert {one.judgement.calibration_id for one in results.values()} == {PRIOR}


def test_a_calibration_in_force_wins(store, fleet) -> None:
    learnt = calibrate([(store, fleet[name]) for name in CLEAN])
    put_first_in_force(store, learnt)
    results = judged(store)
    assert set(provenance(results).values()) == {JudgedBy.LEARNT}
    assert {one.judgement.calibration_id for one in results.values()} == {learnt.calibration_id}
    [alone] = judge_batch(store, [fleet["quay"]], BY_DEFAULT)
    assert (alone.by, alone.judgement.calibration_id) == (JudgedBy.LEARNT, learnt.calibration_id)


def test_another_rig_kind_is_not_mixed_in(store, fleet) -> None:
    others = drives(store, ("oak", "pine", "rowan"), rig=make_rig(4))
    results = judged(store)
    assert {results[name].by for name in others} == {JudgedBy.PRIOR}
    kinds = {store.measurement(one).recording_id for one in others.values()}
    for name in fleet:
        assert results[name].by is JudgedBy.BATCH
        assert not kinds & set(taught_by(store, results[name]))


def test_where_thresholds_of_another_rig_kind_are_in_force_the_gap_stays(store, fleet) -> None:
    oak = add_drive(store, "oak", seed=50, rig=make_rig(focal_px=1400))
    put_first_in_force(store, calibrate([(store, oak)]))
    results = judged(store)
    assert results["oak"].by is JudgedBy.LEARNT
    assert results["alder"].by is JudgedBy.BATCH
    assert results["alder"].gaps == ("no thresholds for its rig kind and matcher",)


@pytest.mark.parametrize(
    "settings",
    [
        JudgeSettings(Criteria(R, Method.PAPER)),
        JudgeSettings(Criteria(R, strict=True)),
    ],
    ids=["paper", "strict"],
)
def test_the_paper_s_method_and_strict_judge_as_before(store, fleet, settings) -> None:
    results = judged(store, settings)
    assert {one.judgement for one in results.values()} == {None}
    assert {one.by for one in results.values()} == {None}
    assert store.ids("calibrations") == []


def test_a_named_calibration_judges_all(store, fleet) -> None:
    named = calibrate([(store, fleet["alder"]), (store, fleet["birch"])])
    results = judged(store, replace(BY_DEFAULT, calibration=named))
    assert {one.judgement.calibration_id for one in results.values()} == {named.calibration_id}
    assert set(provenance(results).values()) == {JudgedBy.LEARNT}


def test_what_is_labelled_as_attacked_never_teaches(store, fleet) -> None:
    labelled = store.measurement(fleet["elm"]).recording_id
    label = GivenLabel(datetime(2026, 3, 2, tzinfo=UTC), topic="/cam1", sensor=1, attack="laser")
    store.write_given_labels(labelled, [label])
    for one in judged(store).values():
        assert labelled not in taught_by(store, one)


def test_a_recording_that_another_one_holds_is_not_judged_by_that(store, fleet) -> None:
    drives(store, (*CLEAN, "fir"))
    part, whole = (store.recording(store.measurement(fleet[name]).recording_id) for name in ("alder", "elm"))
    store.write_recording(replace(part, superseded_by=whole.recording_id))
    results = judged(store)
    for name in ("alder", "elm"):
        taught = taught_by(store, results[name])
        assert not {part.recording_id, whole.recording_id} & set(taught)


def test_what_has_no_frames_or_no_verdicts_never_teaches(store, fleet) -> None:
    empty = add_drive(store, "yew", seed=61, day=61, frames=0)
    frames = [make_measurement(RIG, number) for number in range(FRAMES)]
    withheld = add_measurement(store, RIG, frames, recording="f", name="larch", withheld="its clocks disagree")
    results = judged(store)
    assert results["larch"].by is JudgedBy.PRIOR
    idle = {store.measurement(one).recording_id for one in (empty, withheld)}
    assert not idle & {taught for name in fleet for taught in taught_by(store, results[name])}


def test_recordings_are_at_most_five_groups(store) -> None:
    fleet = drives(store, tuple(f"drive {number:02}" for number in range(12)))
    measurements = list(fleet.values())
    calibrations = calibrations_of_others(store, measurements, measurements, Criteria(R))
    assert len({one.calibration_id for one in calibrations.values()}) == MOST_GROUPS
    assert all(store.measurement(known).recording_id not in one.recordings for known, one in calibrations.items())
    few = measurements[: FEWEST_CLEAN - 1]
    assert calibrations_of_others(store, measurements, few, Criteria(R)) == {}


def test_recordings_that_follow_one_another_are_one_drive_and_do_not_judge_each_other(store) -> None:
    for number, name in enumerate(CLEAN):  # 3.6 s apart
        add_drive(store, name, seed=number, day=0)
    apart = drives_of(store, store.ids("measurements"))
    assert len(set(apart.values())) == 1
    assert set(provenance(judged(store)).values()) == {JudgedBy.PRIOR}

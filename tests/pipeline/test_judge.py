"""Judging what a store holds: what is current afterwards, what is refused, and how much is read for it."""

import json
from collections import Counter
from dataclasses import replace
from decimal import Decimal
from types import SimpleNamespace

import pytest

import auditor
from auditor.errors import StoreError
from auditor.identification import parameters
from auditor.model.verdict import JUDGING_VERSION, Method
from auditor.pipeline.judge import Criteria, judge_measurement, rigs_in_turn
from auditor.pipeline.judged import JudgeSettings, judge_all
from auditor.reporting.incident.loading import load_page
from auditor.store import tables
from auditor.store.queries import run_sql
from auditor.store.store import Store
from auditor.store.tables import read_rows
from auditor.store.versions.history import put_first_in_force
from tests.making import report_stores
from tests.making.calibrations import calibrate
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

RIG = make_rig(3)
ZERO = Decimal(0)
YEARS = 20 * 365 * 24 * 60
"""In minutes."""


@pytest.fixture
def reads(monkeypatch):
    """The files that are opened, one entry each time."""
    opened, parquet_file = [], tables.pq.ParquetFile

    def counted(path):
        opened.append(path)
        return parquet_file(path)

    monkeypatch.setattr(tables.pq, "ParquetFile", counted)
    return opened


def measured(store, recording="a"):
    statistics = [0.001 * place for place in range(20)]
    frames = [make_measurement(RIG, f, [10 + f] * len(RIG.triples), statistics=statistics) for f in range(6)]
    return add_measurement(store, RIG, frames, recording=recording)


def judged(folder, count):
    """A store with so many measurements, a judgement each, and a calibration."""
    store = new_store(folder)
    known = [measured(store, f"{number:x}") for number in range(count)]
    calibration = calibrate([(store, known[0])])
    put_first_in_force(store, calibration)
    for one in known:
        add_judgement(store, RIG, one, "c" * 6, calibration_id=calibration.calibration_id)
    return store, known


@pytest.mark.parametrize("method", Method)
def test_what_was_judged_last_is_current_also_where_the_clock_was_ahead_before(tmp_path, method):
    store = new_store(tmp_path)
    known = measured(store)
    add_judgement(store, RIG, known, "1" * 6, minutes=YEARS)
    calibration = calibrate([(store, known)])
    for r in ("0", "0.5"):
        returned = judge_measurement(store, known, calibration, Criteria(Decimal(r), method))
        assert store.current_judgements()[known] == returned
        sql = "SELECT method, CAST(r AS DOUBLE) AS r FROM judgements WHERE current"
        assert run_sql(store, sql).to_pylist() == [{"method": method, "r": float(r)}]


def test_nothing_is_kept_of_a_judgement_whose_r_has_too_many_decimals(tmp_path):
    store = new_store(tmp_path)
    known = measured(store)
    calibration = calibrate([(store, known)])
    with pytest.raises(StoreError, match="more than 17 decimals; round it"):
        judge_measurement(store, known, calibration, Criteria(Decimal("0.0100000000000000000001")))
    for table in ("judgements", "verdicts", "calibrations"):
        assert not list((store.folder / table).glob("*"))


@pytest.mark.parametrize("method", Method)
def test_judging_opens_no_file_twice_but_frames_and_the_parts_of_a_calibration(tmp_path, reads, method):
    store, known = judged(tmp_path, 7)
    reads.clear()
    results = list(judge_all(Store.open(store.folder), known, JudgeSettings(Criteria(ZERO, method))))
    assert [one.measurement_id for one in results if one.judgement] == known
    opened = Counter(reads)
    of_each = (
        "measurements",
        "judgements",
        "recordings",
        "frames",
        *(["fault_features"] if method is Method.ROBUST else []),
    )
    assert Counter(path.parent.name for path in opened) == {
        **dict.fromkeys(of_each, 7),
        "rigs": 1,
        "calibrations": 1,
        "calibration_history": 1,
    }
    often = {(path.parent.name, times) for path, times in opened.items() if times > 1}
    assert often <= {("frames", 2), ("calibrations", 4)}, "a calibration's recordings are read when they are asked for"


def test_a_page_of_twice_as_many_recordings_reads_twice_as_many_judgements(tmp_path, reads):
    counts = []
    for count in (2, 4):
        store, _ = judged(tmp_path / str(count), count)
        reads.clear()
        load_page(store)
        counts.append(sum(path.parent.name == "judgements" for path in reads))
    assert counts[1] == 2 * counts[0]


@pytest.mark.parametrize("method", Method)
def test_a_changed_parameter_is_another_judgement_and_the_one_before_keeps_its_verdicts_and_rules(
    tmp_path, monkeypatch, method
):
    store = new_store(tmp_path)
    known = measured(store)
    calibration = calibrate([(store, known)])
    before = judge_measurement(store, known, calibration, Criteria(ZERO, method))
    assert judge_measurement(store, known, calibration, Criteria(ZERO, method)).judgement_id == before.judgement_id
    changed = replace(parameters.NAMING, least_probability=0.6)
    others = [changed if group is parameters.NAMING else group for group in parameters.JUDGING]
    monkeypatch.setattr(parameters, "JUDGING", tuple(others))
    after = judge_measurement(store, known, calibration, Criteria(ZERO, method))
    assert {one.judgement_id: one.rules for one in store.judgements()} == {
        before.judgement_id: before.rules,
        after.judgement_id: after.rules,
    }
    rows = run_sql(store, "SELECT * FROM judgements ORDER BY judged_at").to_pylist()
    assert [row["judging_version"] for row in rows] == [JUDGING_VERSION] * 2
    assert [row["auditor_version"] for row in rows] == [auditor.__version__] * 2
    settings = [json.loads(row["judging_settings"])["naming.least_probability"] for row in rows]
    assert settings == [parameters.NAMING.least_probability, 0.6]
    for judgement in (before, after):
        assert len(read_rows("verdicts", store.path("verdicts", judgement.judgement_id))) == 6


WHOLE, FEWER = report_stores.make_rig(), report_stores.make_rig(("velo", "right", "left"))


def beside(**other):
    """Those beside measurement a of a recording that was also measured as b."""
    usual = {"rig_id": "r", "procedure": "sgbm", "withheld": None}
    stored = {"a": SimpleNamespace(**usual), "b": SimpleNamespace(**{**usual, **other})}
    store = SimpleNamespace(
        measurement=stored.__getitem__,
        has_measurement=stored.__contains__,
        rig={"r": WHOLE, "again": WHOLE, "fewer": FEWER}.__getitem__,
    )
    recording = SimpleNamespace(sightings=[SimpleNamespace(measurements=["a", "b", "removed"])])
    return rigs_in_turn(store, recording, "a")


def test_a_rig_of_the_same_sensors_goes_on_where_the_other_ends():
    assert beside(rig_id="again") == ("b",)


@pytest.mark.parametrize(
    "other", [{"rig_id": "fewer"}, {"procedure": "psmnet"}, {"withheld": "points fit the images nowhere"}]
)
def test_other_sensors_other_ways_of_measuring_and_what_cannot_be_judged_do_not(other):
    assert beside(**other) == ()

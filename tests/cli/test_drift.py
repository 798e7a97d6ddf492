"""`auditor drift`: what it prints, its page, its metrics and how it ends."""

import csv
import io
import shutil

import pytest

from auditor.cli.refresh_answers import drift_metrics
from auditor.pipeline.refreshing.drift import fleet_drift
from auditor.store.store import Store
from tests.making.audits import Audit
from tests.making.fleets import add_drive
from tests.making.pages import HOSTILE, Page

DAYS, VISIT = 10, 6


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Three vehicles and ten days; from the seventh on all levels of one are higher, whose name is hostile."""
    store = Store.open(tmp_path_factory.mktemp("fleet") / "audit", create=True)
    for day in range(DAYS):
        for number, vehicle in enumerate((HOSTILE, "car1", "car2")):
            raised = 3.0 if number == 0 and day >= VISIT else 0.0
            add_drive(store, f"v{number}d{day}", seed=10 * day + number, vehicle=vehicle, day=day, raised=raised)
    return store.folder


@pytest.fixture
def audit(fleet, capfdbinary):
    return Audit(fleet, capfdbinary.readouterr)


def test_what_has_changed_is_named_with_its_vehicle_day_and_levels(audit):
    answer = audit("drift", "--format", "json")
    assert answer.code == 1
    assert {row["vehicle"] for row in answer.rows} == {HOSTILE}
    one = next(row for row in answer.rows if row["check"] == "added_light" and row["sensor"] == 1)
    assert (one["after_day"], one["changed_on"]) == ("2026-03-06", "2026-03-07")
    assert one["now"] - one["before"] == pytest.approx(3.0, abs=1.0)
    assert (one["what"], one["calibrated_anew"]) == ("changed", False)
    assert "3 vehicles" in answer.err
    assert "named on 1% of evenings" in answer.err


def test_what_is_steady_is_shown_on_request_and_one_vehicle_alone(audit):
    answer = audit("drift", "--vehicle", "car1", "--all", "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(answer.out.decode())))
    assert answer.code == 0
    assert {(row["vehicle"], row["what"]) for row in rows} == {("car1", "steady")}
    answer = audit("drift", "--vehicle", "car1", "--format", "csv")
    assert answer.out.decode().startswith('"vehicle","sensor","check"'), "a header also without rows"


def test_a_vehicle_that_is_not_there_is_refused_with_the_nearest(audit):
    answer = audit("drift", "--vehicle", "car7")
    assert answer.code == 2
    assert "no recording is of a vehicle 'car7'; did you mean 'car" in answer.err


def test_days_before_the_last_ones_are_not_looked_at(audit):
    answer = audit("drift", "--days", "6", "--all", "--format", "json")
    assert {row["first_day"] for row in answer.rows} == {"2026-03-05"}


def test_a_day_that_has_not_come_hides_no_other(fleet, tmp_path, capfdbinary):
    audit = Audit(shutil.copytree(fleet, tmp_path / "audit"), capfdbinary.readouterr)
    before = audit("drift", "--format", "json").out
    add_drive(Store.open(audit.store), "wrong clock", seed=99, vehicle="car1", day=50_000)
    answer = audit("drift", "--format", "json")
    assert (answer.code, answer.out) == (1, before)
    assert "1 of 31 recordings have no vehicle, or no day that has come, and are left out" in answer.err


def test_too_few_days_are_said_and_are_no_clean_answer(tmp_path, capfdbinary):
    store = Store.open(tmp_path / "audit", create=True)
    add_drive(store, "one", seed=1)
    answer = Audit(store.folder, capfdbinary.readouterr)("drift")
    assert (answer.code, "no vehicle has enough days" in answer.err) == (3, True)


def test_the_page_escapes_names_and_draws_the_levels(audit, tmp_path):
    audit("drift", "--page", tmp_path / "drift.html")
    text = (tmp_path / "drift.html").read_text()
    page = Page(text)
    names = [name for name, _ in page.elements]
    assert "script" not in names
    assert names.count("svg") > 1
    assert "changed on" in page.text


def test_before_and_after_a_day_are_a_query(audit):
    rows = audit("query", "before_after", "day=2026-03-07", "--format", "json").rows
    assert rows[0]["vehicle"] == HOSTILE
    assert abs(rows[0]["change"]) > 1
    assert (rows[0]["days_before"], rows[0]["days_after"]) == (6, 4)
    answer = audit("query", "before_after", "--format", "json")
    assert (answer.code, "parameter day is missing" in answer.err) == (2, True)


def test_a_refresh_writes_drift_among_its_metrics(tmp_path, capfdbinary):
    audit = Audit(tmp_path / "audit", capfdbinary.readouterr)
    add_drive(Store.open(audit.store, create=True), "one", seed=1)
    audit("refresh", "--metrics", tmp_path / "auditor.prom")
    text = (tmp_path / "auditor.prom").read_text()
    assert "auditor_refresh_exit_code 0\n" in text
    assert "# TYPE auditor_drift_levels gauge\nauditor_drift_levels 0\n" in text


def test_metrics_tell_drift_by_vehicle_sensor_and_check(fleet):
    lines = list(drift_metrics(fleet_drift(Store.open(fleet))))
    assert "auditor_drift_vehicles 3" in lines
    ago = [line for line in lines if line.startswith("auditor_drift_changed_days_ago{")]
    assert ago
    assert all(line.endswith(f" {DAYS - 1 - VISIT}") for line in ago)
    assert all("\u202e" not in line and '\\"' in line for line in ago), "names are escaped"

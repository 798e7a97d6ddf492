"""The index of a fleet and the pages of incidents: what they show, that they are accessible, and that they fit."""

import datetime as dt
import re
from pathlib import Path

import pytest

from auditor.errors import StoreError
from auditor.model.pictures import Pictures
from auditor.pipeline.judged import JudgeResult
from auditor.pipeline.measured import MeasureResult
from auditor.pipeline.scan import keep_ledger
from auditor.reporting import fleet
from auditor.reporting.fleet import render_fleet_report
from auditor.reporting.incident.loading import IncidentList
from auditor.reporting.incident.render import render_incident_page
from auditor.reporting.templates import counted
from auditor.store.queries import run_query
from auditor.store.reviews import ReviewVerdict, review_incident
from auditor.store.store import Store
from tests.making.accessibility import complaints, contrasts
from tests.making.pages import BROWSER, HOSTILE, Page, browse, measured_widths
from tests.making.report_stores import add_recording, make_rig, new_store

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Two vehicles: one attacked and partly not audited, one clean and one not judged recording."""
    store = new_store(tmp_path_factory.mktemp("many"))
    attacks = [((1,), 5, 9), ((0,), 20, 31)]
    add_recording(store, "attacked.mcap", attacks=attacks, drives=3, vehicle="car 1", pictured=[7], skipped=[15, 16])
    add_recording(store, "clean.mcap", drives=3, vehicle="car 2")
    add_recording(store, "waiting.mcap", judged=False, vehicle="car 2")
    [_, second] = IncidentList(store, Pictures.NONE).rows
    review_incident(store, second, ReviewVerdict.FALSE_ALARM, "low sun", dt.date(2999, 1, 1))
    return store


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """One recording whose every text is hostile."""
    store = new_store(tmp_path_factory.mktemp("hostile"))
    rig = make_rig(("velo", HOSTILE, "middle", "left"))
    add_recording(store, HOSTILE, rig=rig, attacks=[((1,), 5, 9)], damage=(HOSTILE,), vehicle=HOSTILE, drives=3)
    review_incident(store, IncidentList(store, Pictures.NONE).rows[0], ReviewVerdict.KNOWN, HOSTILE)
    return store


@pytest.fixture(scope="module")
def pages(many: Store, hostile: Store, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages of both, by the names of their folders."""
    folder = tmp_path_factory.mktemp("pages")
    render_fleet_report(many, out=folder / "many")
    render_fleet_report(hostile, out=folder / "hostile")
    return folder


def every(pages: Path) -> list[Path]:
    return sorted(pages.rglob("*.html"))


def read(path: Path) -> Page:
    return Page(path.read_text("utf-8"))


def test_the_index_begins_with_what_was_not_audited_and_lists_the_gravest_incident_first(pages):
    words = read(pages / "many" / "index.html").words.replace("\u00a0", " ")
    order = ["1 incident in 3 recordings", "Not audited, and why", "measured and not judged", "reference missing",
             "Incidents by severity", "S_1 right", "S_0 velo", "low sun", "Vehicles by days"]  # fmt: skip
    assert -1 not in (places := [words.find(text) for text in order])
    assert places == sorted(places)
    assert "car 1 1 incident" in words
    assert "car 2 50.0 % audited" in words


def test_a_day_whose_recording_was_not_fully_audited_is_not_clean(tmp_path):
    store = new_store(tmp_path)
    known = add_recording(store, "mirror.mcap", drives=0, vehicle="car 3")
    recording = store.measurement(known).recording_id
    gap = "no thresholds for its rig kind and matcher"
    measured = MeasureResult(Path("mirror.mcap"), recording, (known,), 40, True, (), ())
    keep_ledger(store, [], [measured], [JudgeResult("mirror.mcap", known, gaps=(gap,))])
    words = read(render_fleet_report(store, out=tmp_path / "index")).words.replace("\u00a0", " ")
    assert gap in words
    assert "car 3 not fully audited 1 recording" in words


@pytest.mark.parametrize(
    ("kind", "said"),
    [("attacked", "an attack explains what was found better than this does: dirt"), ("suspect", "dirt")],
)
def test_the_index_says_that_an_attack_explains_better_what_has_another_cause(many, tmp_path, kind, said):
    rows = [{**row, "kind": kind, "causes": "dirt"} for row in IncidentList(many, Pictures.NONE).rows]
    (tmp_path / "index.html").write_text(fleet.render(fleet.load_fleet(many, rows)), "utf-8")
    assert f"Other causes: {said}" in read(tmp_path / "index.html").words


def test_each_incident_has_a_page_under_its_id_that_the_index_links(many, pages):
    links = [attributes["href"] for tag, attributes in read(pages / "many" / "index.html").elements if tag == "a"]
    known = {row["incident_id"] for row in IncidentList(many, Pictures.NONE).rows}
    assert {f"incidents/{one}.html" for one in known} == set(links)
    for link in links:
        page = pages / "many" / link
        [back] = [attributes["href"] for tag, attributes in read(page).elements if tag == "a"]
        assert (page.parent / back).resolve() == (pages / "many" / "index.html").resolve()


def test_the_page_of_an_incident_has_evidence_alternatives_hashes_calibration_and_rules(many, pages):
    store_rows = IncidentList(many, Pictures.NONE).rows
    row = next(one for one in store_rows if one["review"] is None)
    words = read(pages / "many" / "incidents" / f"{row['incident_id']}.html").words
    assert row["incident_id"] in words
    assert "S1 has light in some rows that the others do not 5" in words
    assert row["alternatives"].replace("S_", "S") in words
    assert "Causes other than an attack none was found" in words
    assert f"auditor review {row['incident_id'][:12]}" in words
    [part] = row["parts"]
    for known in (part["recording_id"], part["measurement_id"], part["judgement_id"], "c" * 64):
        assert known in words
    judged = many.path("judgements", part["judgement_id"])
    assert judged.is_file()
    assert f"verdicts/{part['judgement_id']}.parquet" in words
    assert "The store does not hold the parameters that this was judged by." in words
    other = next(one for one in store_rows if one is not row)
    reviewed = read(pages / "many" / "incidents" / f"{other['incident_id']}.html").words
    assert "false alarm low sun" in reviewed
    assert "2999-01-01" in reviewed


def test_one_page_of_one_incident_refers_to_nothing_outside(many, tmp_path):
    [incident, *_] = run_query(many, "incidents")["incident_id"].to_pylist()
    page = read(render_incident_page(many, incident[:8], out=tmp_path / "one.html"))
    assert not [attributes for tag, attributes in page.elements if tag == "a"]
    with pytest.raises(StoreError, match="the store has no such incident"):
        render_incident_page(many, "0" * 32, out=tmp_path / "none.html")


def test_a_large_store_is_bounded_and_says_what_it_left_out_and_how_to_see_it(many, tmp_path, monkeypatch):
    for name in ("MOST_INCIDENTS", "MOST_REASONS", "MOST_VEHICLES"):
        monkeypatch.setattr(fleet, name, 1)
    words = read(render_fleet_report(many, out=tmp_path)).words.replace("\u00a0", " ")
    assert "1 further incident left out: auditor query incidents has all" in words
    assert "1 further reason left out: auditor query not_audited has all" in words
    assert "Shown are 1 of 2 vehicles" in words
    assert len(list((tmp_path / "incidents").iterdir())) == 1


def test_hostile_text_is_shown_and_never_markup_and_nothing_outside_is_named(pages):
    for path in every(pages):
        page = read(path)
        assert "<script" not in path.read_text("utf-8")
        assert {tag for tag, _ in page.elements}.isdisjoint({"script", "link", "iframe", "object", "base", "form"})
        for tag, attributes in page.elements:
            assert not any(name.startswith("on") for name in attributes)
            for name in ("src", "href", "xlink:href", "srcset", "action"):
                value = attributes.get(name, "data:")
                assert value.startswith("data:") or re.fullmatch(r"(\.\./index|incidents/[0-9a-f]{32})\.html", value), (
                    tag
                )
    assert "<script>alert(1)</script>" in read(pages / "hostile" / "index.html").text


def test_pages_are_accessible(pages):
    assert {path.name: complaints(path.read_text("utf-8")) for path in every(pages)} == {
        path.name: [] for path in every(pages)
    }


@pytest.mark.parametrize("dark", [False, True])
def test_colours_of_text_are_told_from_their_grounds(dark):
    css = (ROOT / "reports" / "style.css").read_text()
    assert {pair: ratio for pair, ratio in contrasts(css, dark=dark).items() if ratio < 4.5} == {}


@pytest.mark.skipif(BROWSER is None, reason="no Chromium to open the page in")
def test_no_page_is_wider_than_a_phone(pages, tmp_path):
    widths = measured_widths(every(pages), tmp_path, 390)
    assert [path for path, width in zip(every(pages), widths, strict=True) if width > 390] == []


@pytest.mark.skipif(BROWSER is None, reason="no Chromium to open the page in")
def test_pages_of_hostile_text_open_without_a_console_message_or_a_request(pages, tmp_path):
    for number, path in enumerate(every(pages / "hostile")):
        (folder := tmp_path / str(number)).mkdir()
        console, addresses, _ = browse(path, folder)
        assert (console, addresses) == ([], [])


@pytest.mark.parametrize(
    ("incidents", "alerts", "words"),
    [(2, 0, "2 incidents"), (2, 1, "1 incident and 1 alert"), (3, 3, "3 alerts"), (1500, 0, "1\u2009500 incidents")],
)
def test_the_headline_counts_alerts_beside_incidents(incidents: int, alerts: int, words: str) -> None:
    assert counted(incidents - alerts, alerts).replace("\u00a0", " ") == words

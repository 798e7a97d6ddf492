"""An incident keeps its name when it grows; frames that its recording lacks are of another one of its drive."""

from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from auditor.casefile.write import CaseSettings, write_case
from auditor.model.pictures import Pictures
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.pictures import picture_incidents
from auditor.reporting.fleet import render_fleet_report
from auditor.store.reviews import ReviewVerdict, in_words, incident_called, incidents_named, review_incident
from tests.making.case_stores import ATTACKED, FRAMES, NAMES, AttackedStore, judge_by_hand
from tests.making.report_stores import WHEN

LATER = WHEN + timedelta(days=1)


@pytest.fixture
def mine(attacked: AttackedStore, tmp_path: Path) -> AttackedStore:
    return attacked.copied(tmp_path)


def judge_anew(mine: AttackedStore, frames: range) -> None:
    judge_by_hand(mine.store, mine.row(0)["measurement_id"], 0, frames, "0.02", LATER)


def test_an_incident_is_called_the_same_by_another_judgement(mine: AttackedStore) -> None:
    before = mine.row(0)
    judge_anew(mine, ATTACKED)
    after = mine.row(0)
    assert after["judgement_id"] != before["judgement_id"]
    assert after["incident_id"] == before["incident_id"]


@pytest.mark.parametrize("frames", [range(3, 11), range(7, 9)])
def test_a_name_of_before_leads_to_the_incident_that_begins_elsewhere_now(mine: AttackedStore, frames: range) -> None:
    before = mine.incident(0)
    judge_anew(mine, frames)
    now = mine.row(0)
    assert now["incident_id"] != before
    assert incidents_named(mine.store, [before]) == {before: now["incident_id"]}
    assert incident_called(mine.store, mine.ask("FROM incidents"), before[:10])["incident_id"] == now["incident_id"]
    assert mine.incident(2) not in incidents_named(mine.store, [before]).values()


def test_the_page_of_a_grown_incident_is_where_links_of_before_lead(mine: AttackedStore, tmp_path: Path) -> None:
    pages, before = tmp_path / "pages" / "incidents", mine.incident(0)
    render_fleet_report(mine.store, out=pages.parent)
    assert (pages / f"{before}.html").is_file()
    judge_anew(mine, range(3, 11))
    render_fleet_report(mine.store, out=pages.parent)
    now = mine.incident(0)
    for name in (before, now):
        text = (pages / f"{name}.html").read_text()
        assert f'Incident <span class="mono">{now}</span>' in text
        assert (f'which was <span class="mono">{before}</span>' in text) == (name == before)
    assert before not in (pages.parent / "index.html").read_text()


def test_a_review_outlives_growth_and_says_so(mine: AttackedStore) -> None:
    review_incident(mine.store, mine.row(0), ReviewVerdict.FALSE_ALARM, "a mirror")
    assert in_words(mine.row(0)) == "reviewed as false alarm: a mirror"
    judge_anew(mine, range(3, 11))
    assert in_words(mine.row(0)) == "reviewed as false alarm: a mirror (it has grown since, from 0.3 to 0.7 s)"


@pytest.fixture
def drive(mine: AttackedStore) -> AttackedStore:
    """Both recordings are of one drive; in the first one every frame is attacked."""
    for record in mine.store.recordings():
        mine.store.write_recording(replace(record, drive="one drive"))
    judge_anew(mine, range(FRAMES))
    return mine


def test_frames_that_the_recording_lacks_are_of_another_one_of_the_drive(drive: AttackedStore) -> None:
    row, other = drive.row(0), drive.row(2)["measurement_id"]
    found = drive.ask(f"FROM incident_examples WHERE incident_id = '{row['incident_id']}'")
    assert {one["example"]: (one["measurement_id"], one["frame"]) for one in found} == {
        "strongest": (row["measurement_id"], FRAMES - 2),
        "after": (other, 0),
        "clean": (other, 0),
    }


def test_they_are_pictured_and_in_the_case_under_names_of_their_own(drive: AttackedStore, tmp_path: Path) -> None:
    row, other = drive.row(0), drive.row(2)["measurement_id"]
    assert all(
        not one.remark
        for one in picture_incidents(drive.store, [row["measurement_id"]], Pictures.ALL, limits_by_size())
    )
    assert drive.store.frame_pictures(other, 0)
    assert not write_case(drive.store, row["incident_id"], tmp_path / "case", CaseSettings()).remarks
    names = {path.name for path in (tmp_path / "case" / "pictures").iterdir()}
    assert {f"{other[:8]}_0_S1.colour.jpg", f"{other[:8]}_0_S0.above.png", f"{FRAMES - 2}_S1.colour.jpg"} <= names
    assert (tmp_path / "case" / "clouds" / f"{other[:8]}_0.ply").is_file()
    page = (tmp_path / "case" / "page.html").read_text()
    assert all(f'src="pictures/{name}"' in page for name in names)
    assert f'after it and the nearest clean frame, in <bdi class="rec">{NAMES[2]}' in page


def test_where_the_other_recording_is_gone_the_case_has_what_the_store_keeps(
    drive: AttackedStore, tmp_path: Path
) -> None:
    row = drive.row(0)
    list(picture_incidents(drive.store, [row["measurement_id"]], Pictures.ALL, limits_by_size()))
    kept = drive.recordings[2].rename(drive.recordings[2].with_name("elsewhere.mcap"))
    try:
        case = write_case(drive.store, row["incident_id"], tmp_path / "case", CaseSettings())
    finally:
        kept.rename(drive.recordings[2])
    [remark] = case.remarks
    assert remark.startswith("the frame after and clean is of another recording and as the store keeps it")
    assert list((tmp_path / "case" / "pictures").glob("*_0_S1.colour.jpg"))

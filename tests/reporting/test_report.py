from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from auditor.errors import StoreError
from auditor.model.coverage import TimeCoverage, TopicCoverage, TopicState
from auditor.model.measurement import Region, Solid, Statistic
from auditor.model.pictures import Pictures
from auditor.model.verdict import VerdictKind
from auditor.reporting.incident.loading import load_page
from auditor.reporting.incident.page import IncidentPage
from auditor.reporting.incident.render import render, render_incident_report
from auditor.store.calibrations import OutdatedCalibrationError, make_calibration
from auditor.store.store import Store
from auditor.store.tables import read_rows, write_rows
from tests.making import stores as making
from tests.making.calibrations import clean_frames
from tests.making.pages import HOSTILE, Page
from tests.making.report_stores import PERIOD_NS, START_NS, add_recording, make_rig, new_store


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


def page_of(store, tmp_path, recording=None):
    return Page(render_incident_report(store, out=tmp_path / "page.html", recording=recording).read_text("utf-8"))


@dataclass(frozen=True)
class Told:
    """A store of one recording, only to be read, what its page is made from, and the page."""

    store: Store
    page: IncidentPage
    shown: Page


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Makes the store and the page of a recording, once for all tests of the same one."""
    made = {}

    def make(**recording):
        key = repr(sorted(recording.items()))
        if key not in made:
            store = new_store(tmp_path_factory.mktemp("told"))
            add_recording(store, **recording)
            page = load_page(store)
            made[key] = Told(store, page, Page(render(page)))
        return made[key]

    return make


def test_the_headline_says_who_when_how_long_and_in_how_many_frames(told):
    headline = "Camera S1 (right) was attacked for 0.9 s in 10 frames, from 2011-09-26 13:02:26.904 UTC."
    assert headline in told(attacks=[((1,), 10, 19)]).shown.words


def test_the_page_is_one_file_that_refers_to_nothing_outside(told, tmp_path):
    store = told(attacks=[((1,), 10, 19)], pictured=[3, 12, 17]).store
    page = page_of(store, tmp_path)
    assert {tag for tag, _ in page.elements}.isdisjoint({"script", "link", "iframe", "object", "base", "form"})
    for tag, attributes in page.elements:
        for name in ("src", "href", "xlink:href", "srcset", "action"):
            assert attributes.get(name, "data:").startswith("data:"), (tag, name)
        assert not any(name.startswith("on") for name in attributes)
    assert "@import" not in (tmp_path / "page.html").read_text("utf-8")
    assert (tmp_path / "page.html").stat().st_size < 300_000


@pytest.mark.parametrize(("pictures", "frames"), [("none", []), ("incidents", ["17"]), ("all", ["12", "17"])])
def test_the_page_shows_no_picture_the_strongest_or_all_of_an_incident(told, pictures, frames):
    store = told(attacks=[((1,), 10, 19)], pictured=[3, 12, 17]).store
    (part,) = load_page(store, pictures=Pictures(pictures)).recordings
    assert sorted({str(view.frame) for view in part.incidents[0].views}) == frames


def test_hostile_text_of_a_recording_is_shown_and_never_markup(store, tmp_path):
    rig = make_rig(("velo", HOSTILE, "middle", "left"))
    add_recording(store, HOSTILE, rig=rig, attacks=[((1,), 5, 9)], damage=(HOSTILE,), vehicle=HOSTILE)
    html = render_incident_report(store, out=tmp_path / "page.html").read_text("utf-8")
    page = Page(html)
    assert "<script" not in html
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert page.text.count("<script>alert(1)</script>\"' onload=x {{ 7 * 7 }}") > 8


def test_a_text_without_end_is_cut(store, tmp_path):
    add_recording(store, "x" * 5000)
    text = page_of(store, tmp_path).text
    assert "x" * 59 + "…" in text
    assert "x" * 61 not in text


def test_an_attack_that_nobody_can_be_named_for_says_so(store, tmp_path):
    rig = make_rig(("", "right", "middle", "left"), lidar=False)
    add_recording(store, rig=rig, attacks=[((2,), 3, 4)])
    words = page_of(store, tmp_path).words
    assert (
        "An attack was detected, but no sensor can be named, for 0.1 s in 2 frames, from 2011-09-26 13:02:26.204 UTC"
        in words
    )
    assert "In 2 frames: an attack on one of 3 sensors cannot be attributed." in words
    assert "(here N = 3, so none)" in words


def test_a_clean_audit_says_so_with_its_coverage(told):
    words = told().shown.words
    assert "No attack was found in 40 audited frames (100.0 % of all frames)." in words
    assert "What this audit cannot see" in words
    assert "Only" not in words.split("Incidents")[0]


def test_frames_that_could_not_be_audited_stand_at_the_top(store, tmp_path):
    add_recording(store, unmeasured=range(4), skipped=[20, 21])
    words = page_of(store, tmp_path).words
    assert "No attack was found in 34 audited frames (85.0 % of all frames)." in words
    assert "Only 85.0 % of all frames could be audited." in words
    assert "40 frames between" in words
    assert "of these 2 could not be put together (reference missing: 2)." in words


def test_what_could_not_be_audited_and_what_was_judged_without_a_sensor_says_why(store, tmp_path):
    add_recording(store, unmeasured=range(4), missing=[(2, 10), (2, 11), (3, 20)])
    words = page_of(store, tmp_path).words
    assert "not auditable in 4 frames: no triple with a threshold has enough valid pixels." in words
    assert "clean in 2 frames: judged without S_2." in words
    assert "not auditable in 1 frame: S_3 missing, and no triple of the other sensors was measured." in words


def test_frames_at_the_edges_of_a_recording_are_not_lost(store, tmp_path):
    add_recording(store, edge=[0, 39])
    words = page_of(store, tmp_path).words
    assert "No attack was found in 38 audited frames (100.0 % of all frames)." in words
    assert "; 2 further frames at its very start and end do not count." in words
    assert "38 frames between 2011-09-26 13:02:26.004 UTC and 2011-09-26 13:02:29.704 UTC" in words


def test_a_share_just_under_the_whole_is_never_shown_as_the_whole(store, tmp_path):
    add_recording(store, frames=3000, skipped=[7])
    assert "(99.9 % of all frames)" in page_of(store, tmp_path).words


def test_nothing_audited_is_not_clean(store, tmp_path):
    add_recording(store, unmeasured=range(40))
    assert "Nothing could be audited" in page_of(store, tmp_path).words


def test_measured_but_not_judged_is_not_clean(store, tmp_path):
    add_recording(store, judged=False)
    words = page_of(store, tmp_path).words
    assert "Measured, not judged" in words
    assert "No attack" not in words


def test_a_recording_without_a_single_frame_gives_a_page(store, tmp_path):
    add_recording(store, frames=0)
    assert "0 frames" in page_of(store, tmp_path).words


def test_without_utc_times_are_told_from_the_first_frame(store, tmp_path):
    add_recording(store, attacks=[((0,), 10, 19)], clock="relative")
    words = page_of(store, tmp_path).words
    assert "LiDAR S0 (velo) was attacked for 0.9 s in 10 frames, from 1.000 s after the first frame." in words
    assert "40 frames in 3.9 s, on a clock that is not UTC: t counts from the first frame." in words
    assert "t = 1.000 s" in words


def test_an_unresolvable_rate_is_marked(store, tmp_path):
    add_recording(store, r="0.001")
    words = page_of(store, tmp_path).words
    assert "r is not resolvable with N" in words
    assert "r by design 0.1 % false-alarm rate of each statistic, not resolvable" in words


def test_incidents_are_runs_of_the_same_finding(store):
    add_recording(store, attacks=[((1,), 5, 9), ((2,), 10, 12), ((0,), 30, 30)])
    incidents = load_page(store).recordings[0].incidents
    assert [(one.number, one.attacked, one.first_frame, one.last_frame) for one in incidents] == [
        (1, (1,), 5, 9),
        (2, (2,), 10, 12),
        (3, (0,), 30, 30),
    ]
    assert [one.states for one in incidents] == [(("101", 5),), (("011", 3),), (("110", 1),)]
    assert incidents[0].from_ns == START_NS + 5 * PERIOD_NS
    assert [one.duration_s for one in incidents] == pytest.approx([0.4, 0.2, 0.0])


def test_the_longest_incident_with_a_name_leads_the_page(store):
    add_recording(store, attacks=[((0,), 2, 3), ((1,), 10, 20), ((0, 2), 25, 39)])
    lead = load_page(store).incidents[0][1]
    assert (lead.kind, lead.attacked) == (
        VerdictKind.ATTACKED,
        (3,),
    )  # two of four speak against the reference: known limit


def test_ground_truth_is_compared_frame_by_frame(told):
    words = told(attacks=[((1,), 5, 9)]).shown.words
    assert "Of 5 labelled frames, 5 were attributed to exactly the sensors that the label names" in words
    assert "of 35 other frames, 0 raised a finding." in words
    assert "A = 510" in words


def test_a_recording_without_labels_has_no_ground_truth(store, tmp_path):
    add_recording(store, attacks=[((1,), 5, 9)], labelled=False)
    words = page_of(store, tmp_path).words
    assert "labelled frames" not in words
    assert "Ground truth" not in words


def test_the_strongest_pictured_frame_of_an_incident_is_shown_with_its_mask(told):
    page = told(attacks=[((1,), 10, 19)], pictured=[3, 12, 17]).shown
    images = [attributes for tag, attributes in page.elements if tag == "img"]
    assert [image["src"].partition(";")[0] for image in images] == [
        "data:image/jpeg",
        "data:image/png",
        "data:image/jpeg",
        "data:image/svg+xml",
    ]
    assert images[0]["alt"] == "Picture of camera S_3 in frame 17"


def test_the_damaged_portion_is_drawn_where_it_lies_and_told(store, tmp_path):
    mask = cv2.imencode(".png", np.zeros((94, 311), np.uint8))[1].tobytes()
    light = Region(1, 1, (8, 16, 400, 240), 0.25, mask)
    other = Region(3, 3, (0, 0, 4, 4), 0.5, mask)
    wall = Region(0, 3, (8, 16, 80, 64), 0.125, mask, 850, Solid((8, -1, 0.5), (2.5, 1.5, 0.1), 4))
    attacks = [((1,), 10, 19), ((0,), 30, 35)]
    add_recording(store, attacks=attacks, pictured=[17, 33], regions=(light, other, wall))
    page = page_of(store, tmp_path)
    boxes = [attributes for tag, attributes in page.elements if attributes.get("class") == "box"]
    assert [tuple(box[side] for side in ("x", "y", "width", "height")) for box in boxes] == [
        ("8", "16", "392", "224"),
        ("8", "16", "72", "48"),
    ]
    ids = [attributes["id"] for tag, attributes in page.elements if tag == "mask"]
    assert [known.split("-", 2)[2] for known in ids] == ["1-17-1-1", "1-33-3-0"]  # part, frame, view, sensor
    assert "Damaged: 25 % of the image." in page.words
    assert "Damaged: 850 LiDAR points, 12 % of those in view, in a box 2.5 x 1.5 x 0.1 m" in page.words


def test_without_pictures_there_is_none_but_that_of_the_rig(told):
    elements = told(attacks=[((1,), 10, 19)]).shown.elements
    assert [attributes["class"] for tag, attributes in elements if tag == "img"] == ["rig"]


def test_sensors_are_listed_with_their_states_and_medians(store):
    add_recording(store, frames=5, missing=[(2, 1), (2, 3)])
    sensors = load_page(store).recordings[0].sensors
    assert [(one.present, one.missing, one.damaged) for one in sensors] == [(5, 0, 0), (5, 0, 0), (3, 2, 0), (5, 0, 0)]
    assert sensors[0].returns == 18_002
    assert sensors[1].textureless_share == 0.2


def test_the_mass_balance_and_a_balance_that_fails_are_shown(told):
    assert "All topics 568 160 400 0 8" in told().shown.words
    page = told().page
    (recording,) = page.recordings
    broken = replace(recording.balance[0], read=1)
    page = replace(page, recordings=(replace(recording, balance=(broken, *recording.balance[1:])),))
    assert "does not add up" in Page(render(page)).words


def test_what_was_not_read_is_told_beside_the_coverage(store, tmp_path):
    time = TimeCoverage(10**10, 10**9, early_ns=9 * 10**9)
    known = ("sensor_msgs/msg/Image", "camera")
    camera = TopicCoverage("/c", *known, TopicState.READ, 1, "right", 100, 75, {"stamp repeated": 25}, time)
    livox = ("/livox", "livox_ros_driver2/msg/CustomMsg", "LiDAR", TopicState.UNREADABLE, None, "livox", 7)
    unread = TopicCoverage(*livox, reason="it cannot be decoded", remedy="convert <it>")
    left_out = TopicCoverage("/side", *known, TopicState.LEFT_OUT, None, "side", 9, reason="no camera info")
    add_recording(store, coverage=(camera, unread, left_out))
    words = page_of(store, tmp_path).words
    assert "coverage 75 % of messages, 10 % of time: right 25 stamps repeated; ends 9.0 s early" in words
    assert "1 sensor cannot be read: /livox (LiDAR): it cannot be decoded; convert <it>" in words
    assert "/livox LiDAR unreadable 7 it cannot be decoded; convert <it>" in words
    assert "/side camera left out 9 no camera info" in words


def test_provenance_names_everything_that_decided_the_verdicts(told):
    words = told().shown.words
    (recording,) = told().page.recordings
    for text in (
        recording.recording_id,
        *told().store.ids("measurements"),
        recording.provenance.rig_id,
        recording.provenance.calibration_id,
        "range_px = 128",
        "cv2 5.0.0",
        "θ0,1,3 = 0.0590 (N = 50)",
        "Method algorithm2 on the gated disparity error at r = 0 %",
    ):
        assert text in words


def test_several_recordings_are_listed_and_their_incidents_numbered_through(store):
    add_recording(store, "a.mcap", attacks=[((1,), 5, 9)])
    add_recording(store, "b.mcap")
    add_recording(store, "c.mcap", attacks=[((2,), 5, 12)])
    page = load_page(store)
    assert [[one.number for one in recording.incidents] for recording in page.recordings] == [[1], [], [2]]
    words = Page(render(page)).words
    assert "Camera S2 (middle) was attacked" in words.split("Incidents")[0]
    assert "This is the longest of 2 incidents in 3 recordings" in words
    assert words.count("Settings and provenance") == 3


def test_none_of_several_as_long_is_called_the_longest(store, tmp_path):
    add_recording(store, "a.mcap", attacks=[((1,), 5, 9)])
    add_recording(store, "b.mcap", attacks=[((2,), 5, 9)], vehicle=None)
    words = page_of(store, tmp_path).words
    assert "This is one of 2 incidents in 2 recordings" in words
    assert "10 frames in incidents or alerts Frames audited" in words


def test_frames_in_incidents_and_those_raised_alone_are_told_apart(told):
    page = told(attacks=[((1,), 5, 9)]).page
    (recording,) = page.recordings
    page = replace(page, recordings=(replace(recording, told=4, alone=1),))
    words = Page(render(page)).words
    assert "1 4 frames in incidents or alerts, 1 raised alone" in words
    assert (
        "1 frame raised alone belongs to no incident and no alert: too little before and after it says the same"
        in words
    )


def test_vehicles_have_a_column_where_some_are_known_and_one_recording_is_found_by_name_and_id(store, tmp_path):
    add_recording(store, "a.mcap", vehicle=None)
    add_recording(store, "b.mcap", vehicle=None)
    assert "Recording From Duration" in page_of(store, tmp_path).words
    add_recording(store, "c.mcap")
    assert "Recording Vehicle From Duration" in page_of(store, tmp_path).words
    [wanted] = [one.recording_id for one in store.recordings() if one.name == "c.mcap"]
    for named in ("c.mcap", wanted[:12]):
        assert [one.name for one in load_page(store, named).recordings] == ["c.mcap"]


def test_of_many_incidents_some_are_only_listed(told):
    many = told(frames=90, attacks=[((1,), first, first) for first in range(2, 90, 6)])
    (recording,) = many.page.recordings
    assert len(recording.incidents) == 15
    assert sum(1 for one in recording.incidents if one.figure is not None) == 6
    assert "9 incidents of this recording are in the table above but not drawn." in many.shown.words


def test_an_unknown_recording_is_refused(told, tmp_path):
    with pytest.raises(StoreError, match=r"no recording has the name or id 'other'"):
        page_of(told().store, tmp_path, "other")


def test_an_empty_store_is_told_what_to_do(store, tmp_path):
    with pytest.raises(StoreError, match="run auditor scan first"):
        page_of(store, tmp_path)


def test_a_page_that_cannot_be_written_leaves_the_old_one_and_says_so(told, tmp_path):
    (tmp_path / "file").write_text("old")
    with pytest.raises(StoreError):
        render_incident_report(told().store, out=tmp_path / "file" / "page.html")
    assert (tmp_path / "file").read_text() == "old"


def test_a_recording_that_was_only_calibrated_on_is_not_part_of_the_audit(store, tmp_path):
    add_recording(store, attacks=[((1,), 10, 19)])
    add_recording(store, "b.mcap", judged=False)
    assert "b.mcap" in page_of(store, tmp_path).words
    rig = store.rig(store.measurements()[0].rig_id)
    samples = {(Statistic.GATED, triple): [0.1] for triple in rig.triples}
    [learnt_on] = [one.recording_id for one in store.recordings() if one.name == "b.mcap"]
    store.write_calibration(
        make_calibration(rig.kind, store.measurements()[0].procedure, clean_frames(samples, [learnt_on]))
    )
    words = page_of(store, tmp_path).words
    assert "b.mcap" not in words
    assert "could be audited" not in words


def test_a_judgement_by_a_calibration_that_is_refused_by_now_still_says_what_it_was_made_from(store, tmp_path):
    add_recording(store)
    (calibration_id,) = store.ids("calibrations")
    path = store.path("calibrations", calibration_id)
    rows = read_rows("calibrations", path)
    write_rows("calibrations", path, [{**row, "counting_version": row["counting_version"] - 1} for row in rows])
    with pytest.raises(OutdatedCalibrationError):
        store.calibration(calibration_id)
    assert "from 1 clean recording: abababababab" in page_of(store, tmp_path).words


def test_incidents_before_and_after_a_clock_was_set_back_are_told_of_their_own_frames(store):
    rig = making.make_rig(3)
    stamps = [f * PERIOD_NS for f in (*range(10), *range(5, 15))]
    frames = [making.make_measurement(rig, f, stamp_ns=stamp) for f, stamp in enumerate(stamps)]
    known = making.add_measurement(store, rig, frames)
    making.add_judgement(store, rig, known, "c" * 6 + "111" + "c" * 2 + "11" + "c" * 7, stamps=stamps)
    (part,) = load_page(store).recordings
    assert [incident.first_frame for incident in part.incidents] == [6, 11]
    assert [dict(incident.states) for incident in part.incidents] == [{"000": 3}, {"000": 2}]

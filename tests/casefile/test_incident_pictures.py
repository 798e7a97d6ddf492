"""Pictures are chosen by the verdict: each incident has those of the frames that show it."""

import base64
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.cli import run
from auditor.measurement.drawing import damaged_cloud
from auditor.model.pictures import Content, Pictures
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.pictures import MOST_INCIDENTS, frames_at_hand, picture_incidents
from auditor.reporting.incident.render import render_incident_page, render_incident_report
from auditor.store.maintenance.removal import remove_measurement
from auditor.store.maintenance.verify import verify
from auditor.store.store import Store
from tests.making.accessibility import complaints
from tests.making.case_stores import AttackedStore, recorded_frames


def decoded(data: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


def test_every_incident_has_pictures_of_all_sensors_before_at_and_after_it(attacked: AttackedStore) -> None:
    store, due = (
        attacked.store,
        {(1, "colour"), (2, "colour"), (3, "colour"), (4, "colour"), (0, "above"), (0, "range")},
    )
    incidents = attacked.ask("FROM incidents")
    assert len(incidents) == 2
    for incident in incidents:
        rows = attacked.ask(f"FROM incident_examples WHERE incident_id = '{incident['incident_id']}'")
        examples = {row["example"]: row["frame"] for row in rows}
        assert examples["strongest"] == incident["strongest_frame"]
        assert examples["before"] < incident["first_frame"]
        assert examples["after"] > incident["last_frame"]
        assert "clean" in examples
        for frame in examples.values():
            pictures = store.frame_pictures(incident["strongest_measurement_id"], frame)
            assert {(one.sensor, one.content.value) for one in pictures} >= due


def test_pictures_are_what_the_cameras_recorded_at_full_resolution(attacked: AttackedStore) -> None:
    row = attacked.row(2)
    frames, strongest = recorded_frames(attacked.recordings[2]), row["strongest_frame"]
    pictures = attacked.store.frame_pictures(row["measurement_id"], strongest)
    colours = [one for one in pictures if one.content is Content.COLOUR]
    assert len(colours) == 4
    for one in colours:
        recorded = frames[strongest].images[one.sensor].pixels
        assert decoded(one.data).shape[:2] == recorded.shape[:2]
        assert np.abs(decoded(one.data)[..., 0].astype(int) - recorded).mean() < 12  # JPEG, of noise


def test_the_view_has_the_contents_of_all_pictures(attacked: AttackedStore) -> None:
    rows = attacked.ask("SELECT content, sensor, count(*) AS n FROM pictures GROUP BY ALL")
    contents = {row["content"] for row in rows}
    assert contents == {"view", "mask", "colour", "overlay", "above", "range"}
    assert {row["sensor"] for row in rows if row["content"] in ("above", "range")} == {0}


def test_an_overlay_marks_the_damaged_portion_of_the_attacked_camera(attacked: AttackedStore) -> None:
    row = attacked.row(2)
    kept = attacked.store.frame_pictures(row["measurement_id"], row["strongest_frame"])
    pictures = {(one.sensor, one.content): one for one in kept}
    plain, drawn = (decoded(pictures[2, content].data).astype(int) for content in (Content.COLOUR, Content.OVERLAY))
    changed = np.abs(plain - drawn).sum(axis=2) > 60
    assert changed[40:, 80:].mean() > 0.9  # the white part
    assert changed[40:, :40].mean() < 0.2


def test_frames_outside_of_the_incident_and_sensors_that_were_not_attacked_have_no_overlay(
    attacked: AttackedStore,
) -> None:
    for sensor in (0, 2):
        row = attacked.row(sensor)
        drawn = attacked.ask(f"FROM pictures WHERE content = 'overlay' AND measurement_id = '{row['measurement_id']}'")
        assert {one["frame"] for one in drawn} == {row["strongest_frame"]}
        wanted = {
            one["view"]
            for one in attacked.ask(
                f"FROM regions WHERE measurement_id = '{row['measurement_id']}' "
                f"AND sensor = {sensor} AND frame = {row['strongest_frame']}"
            )
        }
        assert {one["sensor"] for one in drawn} == wanted


def test_the_page_of_an_incident_shows_all_its_frames_at_full_resolution_and_its_place(
    attacked: AttackedStore, tmp_path: Path
) -> None:
    row = attacked.row(2)
    page = render_incident_page(attacked.store, row["incident_id"], out=tmp_path / "page.html").read_text()
    assert complaints(page) == []
    for frame in (row["first_frame"] - 1, row["strongest_frame"], row["last_frame"] + 1):
        for one in attacked.store.frame_pictures(row["measurement_id"], frame):
            assert base64.b64encode(one.data).decode() in page
    assert f"Frame {row['strongest_frame']}: its strongest frame" in page
    assert "data:image/svg+xml" in page
    assert "after it and the nearest clean frame" in page
    one_page = render_incident_report(attacked.store, out=tmp_path / "all.html").read_text()
    assert complaints(one_page) == []
    assert f"Frame {row['strongest_frame']}: its strongest frame" in one_page
    assert "before it" not in one_page
    bare = render_incident_page(attacked.store, row["incident_id"], out=tmp_path / "bare.html", pictures=Pictures.NONE)
    assert "None was kept" in bare.read_text()
    assert "data:image/jpeg" not in bare.read_text()


def test_damaged_points_are_those_that_were_measured(attacked: AttackedStore) -> None:
    store, row = attacked.store, attacked.row(0)
    known, number = row["measurement_id"], row["strongest_frame"]
    rig = store.rig(row["rig_id"])
    [frame] = frames_at_hand(store, known, [number])
    [region] = [one for one in store.load_regions(known, number) if one.sensor == 0]
    assert frame.cloud is not None
    assert region.points is not None
    marked = np.count_nonzero(damaged_cloud(frame.cloud, rig, [region]))
    assert region.points <= marked <= 1.02 * region.points
    assert not damaged_cloud(frame.cloud, rig, []).any()


def test_a_second_scan_pictures_nothing_again(attacked: AttackedStore) -> None:
    known = [one.measurement_id for one in attacked.store.measurements()]
    done = picture_incidents(attacked.store, known, Pictures.ALL, limits_by_size())
    assert [one.frames for one in done] == []


def test_a_scan_pictures_what_it_finds_unless_none_are_wanted(attacked: AttackedStore, tmp_path: Path) -> None:
    store, how = tmp_path / "audit", ["--jobs", "1"]
    assert run(["scan", str(attacked.recordings[2]), "--store", str(store), *how, "--pictures", "none"]) == 1
    assert not list(store.glob("pictures/*/*"))
    assert run(["scan", str(attacked.recordings[2]), "--store", str(store), *how]) == 1  # it is measured already
    assert list(store.glob("pictures/*/*.colour.jpg"))


@pytest.mark.parametrize("change", ["gone", "changed"])
def test_a_recording_that_is_gone_or_another_gives_one_remark(
    attacked: AttackedStore, tmp_path: Path, change: str
) -> None:
    mine = attacked.copied(tmp_path)
    store = mine.store
    for picture in store.folder.glob("pictures/*/*.*.*"):
        picture.unlink()
    kept = attacked.recordings[0].read_bytes()
    try:
        if change == "gone":
            attacked.recordings[0].unlink()
        else:
            attacked.recordings[0].write_bytes(kept[:-1] + b"?")
        [done] = picture_incidents(store, [attacked.row(0)["measurement_id"]], Pictures.ALL, limits_by_size())
    finally:
        attacked.recordings[0].write_bytes(kept)
    assert done.frames == 0
    assert ("not there any more" if change == "gone" else "not what was measured") in done.remark
    assert not list(store.folder.glob("pictures/*/*.*.*"))


def test_the_weakest_of_very_many_incidents_get_none_and_that_is_said(
    attacked: AttackedStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_INCIDENTS == 100
    monkeypatch.setattr("auditor.pipeline.pictures.MOST_INCIDENTS", 0)
    known = attacked.row(0)["measurement_id"]
    [done] = picture_incidents(attacked.store, [known], Pictures.ALL, limits_by_size())
    assert "the weakest, get no pictures" in done.remark


def problems(store: Store) -> list[str]:
    """The places that differ; that verdicts written by hand have no calibration is none."""
    return [one.place for one in verify(store).problems if "calibration_id" not in one.what]


def test_the_log_knows_the_pictures_and_their_removal(attacked: AttackedStore, tmp_path: Path) -> None:
    store = attacked.copied(tmp_path).store
    assert not problems(store)
    [picture] = sorted(store.folder.glob("pictures/*/*.colour.jpg"))[:1]
    kept = picture.read_bytes()
    picture.write_bytes(kept + b"?")
    assert problems(store) == [picture.relative_to(store.folder).as_posix()]
    picture.write_bytes(kept)
    remove_measurement(store, store.measurements()[0].measurement_id)
    assert not problems(store)

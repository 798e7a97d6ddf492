"""A case: its rows, its timeline, its pages and clouds; written whole or not at all."""

import csv
import json
from datetime import datetime
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from auditor.casefile import write as writing
from auditor.casefile.case import NO_REDACTION, Case
from auditor.casefile.write import CaseSettings, write_case
from auditor.errors import AuditorError, SettingError, StoreError
from auditor.reporting.incident.incident import Incident
from tests.making.case_stores import FRAMES, NAMES, VEHICLE, AttackedStore


def test_the_rows_are_those_of_the_store_as_parquet_and_csv(attacked: AttackedStore, lidar_case: Path) -> None:
    [row] = pq.read_table(lidar_case / "rows" / "incident.parquet").to_pylist()
    assert row["incident_id"] == attacked.incident(0)
    verdicts = pq.read_table(lidar_case / "rows" / "verdicts.parquet")
    wanted = attacked.row(0)
    assert verdicts["frame"].to_pylist() == list(
        range(wanted["first_frame"] - 2, min(wanted["last_frame"] + 2, FRAMES - 1) + 1)
    )
    for path in (lidar_case / "rows").glob("*.parquet"):
        with path.with_suffix(".csv").open(newline="") as file:
            assert len(list(csv.reader(file))) == 1 + pq.read_metadata(path).num_rows
    assert pq.read_metadata(lidar_case / "rows" / "poses.parquet").num_rows == len(verdicts)


def test_the_ticket_says_what_and_where(attacked: AttackedStore, lidar_case: Path) -> None:
    ticket = json.loads((lidar_case / "ticket.json").read_text())
    assert ticket["title"].startswith("S_0 attacked for ")
    assert (ticket["name"], ticket["vehicle"], ticket["path"]) == (NAMES[0], VEHICLE, str(attacked.recordings[0]))
    assert ticket["strongest_frame"] == attacked.row(0)["strongest_frame"]
    assert ticket["remarks"] == []


def test_every_line_of_the_timeline_is_one_that_timesketch_imports(attacked: AttackedStore, lidar_case: Path) -> None:
    lines = [json.loads(line) for line in (lidar_case / "timeline.jsonl").read_text().splitlines()]
    row = attacked.row(0)
    assert len(lines) == 2 + row["frames"]
    for line in lines:
        assert all(isinstance(line[name], str) and line[name] for name in ("message", "datetime", "timestamp_desc"))
        moment = datetime.fromisoformat(line["datetime"])
        assert moment.utcoffset() is not None
        assert round(moment.timestamp() * 10**6) == line["timestamp"] == line["stamp_ns"] // 1000
    assert [lines[0]["stamp_ns"], lines[-1]["stamp_ns"]] == [row["from_ns"], row["to_ns"]]


def test_clouds_are_ply_files_with_the_damaged_points_marked(attacked: AttackedStore, lidar_case: Path) -> None:
    strongest = attacked.row(0)["strongest_frame"]
    content = (lidar_case / "clouds" / f"{strongest}.ply").read_bytes()
    header, _, body = content.partition(b"end_header\n")
    count = int(header.split(b"element vertex ")[1].split()[0])
    vertices = np.frombuffer(body, [("xyz", "<f4", 3), ("colour", "u1", 3), ("damaged", "u1")])
    assert len(vertices) == count
    region = attacked.region(strongest)
    assert np.isclose(vertices["damaged"].sum(), region["points"], rtol=0.02)


def test_the_first_page_shows_each_picture_and_refers_to_the_folder_alone(lidar_case: Path) -> None:
    page = (lidar_case / "index.html").read_text()
    pictures = [path.name for path in (lidar_case / "pictures").iterdir()]
    assert len(pictures) >= 3 * 6  # of three frames: four cameras and the cloud twice
    assert all(f'src="pictures/{name}"' in page for name in pictures)
    assert "http://" not in page
    assert "https://" not in page
    assert 'src="place.svg"' in page
    assert "polyline" in (lidar_case / "place.svg").read_text()


def test_a_case_is_its_owners_alone(lidar_case: Path) -> None:
    modes = {(path.is_dir(), path.stat().st_mode & 0o777) for path in (lidar_case, *lidar_case.rglob("*"))}
    assert modes == {(True, 0o700), (False, 0o600)}


def test_without_its_recording_a_case_says_what_it_lacks(attacked: AttackedStore, tmp_path: Path) -> None:
    kept = attacked.recordings[2].rename(attacked.recordings[2].with_name("elsewhere.mcap"))
    try:
        case = write_case(attacked.store, attacked.incident(2), tmp_path / "case", CaseSettings())
    finally:
        kept.rename(attacked.recordings[2])
    [remark] = case.remarks
    assert remark.startswith("no clip; the pictures are those that the store keeps: the recording is not there")
    assert not (tmp_path / "case" / "clip.mcap").exists()
    assert not (tmp_path / "case" / "clouds").exists()
    assert list((tmp_path / "case" / "pictures").glob("*_S2.overlay.jpg"))
    assert remark in (tmp_path / "case" / "index.html").read_text()
    assert json.loads((tmp_path / "case" / "manifest.json").read_text())["predicate"]["lacks"] == [remark]


def test_a_changed_recording_gives_no_clip(attacked: AttackedStore, tmp_path: Path) -> None:
    case = Case(Incident(attacked.store, attacked.row(2)), 0.3, tmp_path, NO_REDACTION)
    kept = attacked.recordings[2].read_bytes()
    attacked.recordings[2].write_bytes(kept[:-1] + b"?")
    try:
        [remark] = writing._write_recorded(case, CaseSettings().limits)
    finally:
        attacked.recordings[2].write_bytes(kept)
    assert "the recording is not what was measured" in remark
    assert {path.name for path in tmp_path.iterdir()} == {"findings.mcap", "pictures"}


def test_a_case_is_written_whole_or_not_at_all(
    attacked: AttackedStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def some(case: Case, *_: object) -> tuple[str, ...]:
        case.write("pictures/1_S1.colour.jpg", b"")
        return ()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writing, "_write_recorded", some)
    monkeypatch.setattr(writing, "write_rows", full)
    with pytest.raises(SettingError, match="No space left"):
        write_case(attacked.store, attacked.incident(2), tmp_path / "case", CaseSettings())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wanted", ["", "zz", "0123456789"])
def test_an_incident_that_is_not_just_one_is_refused(attacked: AttackedStore, tmp_path: Path, wanted: str) -> None:
    with pytest.raises(StoreError):
        write_case(attacked.store, wanted, tmp_path / "case", CaseSettings())


def test_what_exists_is_not_written_over(attacked: AttackedStore, lidar_case: Path) -> None:
    with pytest.raises(AuditorError, match="exists already"):
        write_case(attacked.store, attacked.incident(0), lidar_case, CaseSettings())

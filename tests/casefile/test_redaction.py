"""A redacted case shows the attack, and neither names, nor places, nor what else the cameras saw."""

import re
import socket
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
from mcap.reader import make_reader

from auditor.casefile.case import Redaction
from auditor.casefile.write import CaseSettings, write_case
from auditor.store.reviews import ReviewVerdict, review_incident
from tests.making.case_stores import NAMES, VEHICLE, AttackedStore, recorded_frames


def test_no_name_and_no_path_is_anywhere_in_it(attacked: AttackedStore, redacted_case: Path) -> None:
    secrets = [
        *NAMES.values(),
        *(name.removesuffix(".mcap") for name in NAMES.values()),
        VEHICLE,
        "Quagga",
        "camera_2",
        "camera_4",
        "/points",
        str(attacked.folder),
        str(attacked.recordings[2].parent),
        *([socket.gethostname()] if len(socket.gethostname()) > 6 else []),
    ]
    pattern = re.compile("|".join(map(re.escape, secrets)).encode())
    contents = {path.name: path.read_bytes() for path in redacted_case.rglob("*") if path.is_file()}
    for path in redacted_case.rglob("*.parquet"):  # what is compressed is looked into
        metadata = pq.read_metadata(path)
        inside = (pq.read_table(path).to_pylist(), metadata.metadata, metadata.to_dict(), pq.read_schema(path))
        contents[f"{path.name} inside"] = repr(inside).encode()
    with (redacted_case / "findings.mcap").open("rb") as stream:
        reader = make_reader(stream)
        described = (reader.get_header(), list(reader.iter_metadata()), list(reader.iter_attachments()))
        contents["findings.mcap described"] = repr(described).encode()
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            contents[f"{channel.topic} {message.log_time}"] = b" ".join(
                (channel.topic.encode(), schema.data, bytes(message.data))
            )
    assert len(contents) > 50
    assert {name: pattern.findall(content) for name, content in contents.items() if pattern.search(content)} == {}


def test_there_is_no_clip_no_place_and_no_pose(redacted_case: Path) -> None:
    assert not (redacted_case / "clip.mcap").exists()
    assert not (redacted_case / "place.svg").exists()
    assert 'class="rig"' not in (redacted_case / "page.html").read_text("utf-8"), "it would have the sensors' names"
    assert not list((redacted_case / "rows").glob("poses.*"))
    assert b"49.0" not in (redacted_case / "ticket.json").read_bytes()


def test_all_is_blurred_but_the_damaged_portion(attacked: AttackedStore, redacted_case: Path) -> None:
    frame = attacked.row(2)["strongest_frame"]
    frames = recorded_frames(attacked.recordings[2])
    for sensor in (1, 2, 3, 4):
        path = redacted_case / "pictures" / f"{frame}_S{sensor}.colour.jpg"
        shown = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        recorded = frames[frame].images[sensor].pixels
        assert recorded[:, :40].std() > 60  # noise, of which nothing is to be seen any more
        assert shown[:, :40].std() < 30
        if sensor == 2:
            assert np.abs(shown[20:100, 100:300].astype(int) - recorded[20:100, 100:300]).max() < 8
    report = (redacted_case / "page.html").read_text()
    assert "data:image/jpeg" not in report


def test_names_are_left_out_where_they_are_words_and_no_others_change() -> None:
    redaction = Redaction(("/data/fleet/night.mcap", "night.mcap", "fleet"))
    assert redaction.text("/data/fleet/night.mcap of fleets, night.mcap") == "[left out] of fleets, [left out]"
    assert redaction.cell("vehicle", "7") == "[left out]"
    assert redaction.cell("reason", "7 frames") == "7 frames"
    assert redaction.value({"name": "x", "n": 1, "of": [("fleet", 2)]}) == {
        "name": "[left out]",
        "n": 1,
        "of": [("[left out]", 2)],
    }
    assert Redaction(()).text("nothing is secret") == "nothing is secret"


def test_names_too_short_to_be_searched_for_and_what_reviewers_wrote_are_left_out(
    attacked: AttackedStore, tmp_path: Path
) -> None:
    mine = attacked.copied(tmp_path)
    store = mine.store
    store.write_recording(replace(store.recording(mine.row(2)["recording_id"]), name="ü4"))
    review_incident(store, mine.row(2), ReviewVerdict.KNOWN, "seen by Wombat in Lane 9")
    write_case(store, mine.incident(2), tmp_path / "case", CaseSettings(redact=True))
    texts = [path.read_text() for path in (tmp_path / "case").iterdir() if path.suffix in (".html", ".json", ".jsonl")]
    texts += [path.read_text() for path in (tmp_path / "case" / "rows").glob("*.csv")]
    assert len(texts) > 10
    assert not [text for text in texts if "ü4" in text or "\\u00fc4" in text or "Wombat" in text]
    assert "S_2 attacked for 0.3 s in [left out]" in (tmp_path / "case" / "index.html").read_text()

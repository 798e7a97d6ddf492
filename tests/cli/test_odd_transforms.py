"""Transforms that tf cannot mean: they are named with what is wrong with them."""

from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.recordings import open_recording, schemas
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making.small_drives import THREE_CAMERAS, write_drive

TF = Topic("/tf", schemas.TRANSFORMS, "cdr")


def not_finite() -> np.ndarray:
    place = np.eye(4)
    place[0, 3] = np.nan
    return place


@pytest.mark.parametrize(
    ("sent", "says"),
    [
        ([("mast", "radar", not_finite())], "/tf: mast to radar: its numbers are absurdly large or not finite"),
        ([("mast", "mast", np.eye(4))], "/tf: mast to mast: a frame cannot be its own parent: it is left out"),
        (
            [("a", "b", np.eye(4)), ("b", "c", np.eye(4)), ("c", "a", np.eye(4))],
            "/tf: c to a: a loop, a is above c already: it is left out",
        ),
    ],
    ids=["not finite", "its own parent", "a loop"],
)
def test_a_transform_that_is_left_out_is_named_by_inspect_and_scan(
    sent: list[tuple[str, str, np.ndarray]], says: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = with_transforms(tmp_path, sent)
    run(["inspect", str(path)])
    assert says in " ".join(capfd.readouterr().out.split())
    run(["scan", str(path), "--store", str(tmp_path / "store"), "--pictures", "none"])
    assert f"WARNING: {says}" in " ".join(capfd.readouterr().err.split())


def with_transforms(folder: Path, sent: list[tuple[str, str, np.ndarray]]) -> Path:
    """A drive with a message for each of some transforms, as parent, child and place, before its others."""
    drive, maker = write_drive(folder / "drive.mcap", 2, positions_m=THREE_CAMERAS), MessageMaker("cdr")
    definition = Definition("ros2msg", maker.definition(TF.schema).encode())
    with open_recording(drive) as recording, mcap_file(folder / "odd.mcap", profile="ros2", compression="zstd") as file:
        kept = list(recording.messages())
        topics = {topic.name: topic for topic in recording.topics()}
        for parent, child, place in sent:
            data = maker.transforms(parent, {child: place}, kept[0].log_time_ns)
            file.write(TF, definition, kept[0].log_time_ns, data)
        for one in kept:
            topic = topics[one.topic]
            file.write(topic, recording.definition(topic.schema), one.log_time_ns, one.data)
    return folder / "odd.mcap"

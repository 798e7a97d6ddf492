"""A recording whose tf is made to be slow, or large."""

from pathlib import Path

import numpy as np
import pytest

from auditor.recordings import open_recording, schemas, survey
from auditor.recordings.decoding.geometry import RosTransformsDecoder
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.rigs.in_force import rigs_in_force
from auditor.recordings.synchronisation import descriptions as surveying
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from auditor.safety.budget import MAX_TRANSFORM_BYTES, MAX_TRANSFORMS, MAX_TRANSFORMS_BYTES
from tests.making.small_drives import THREE_CAMERAS, write_drive

FEW_BYTES = 2 * 2**20
"""A limit of all transforms that takes a file of 2 MB to exceed, not one of 16."""
TF = Topic("/tf", schemas.TRANSFORMS, "cdr")


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "drive.mcap", 4, positions_m=THREE_CAMERAS)


def with_tf(
    drive: Path, target: Path, messages: int, frames: int, *, again: bool = False, behind: bool = False
) -> Path:
    """A copy with more tf before its other messages or behind them: so many messages of so many new frames each."""
    maker = MessageMaker("cdr")
    definition = Definition("ros2msg", maker.definition(TF.schema).encode())
    with open_recording(drive) as recording, mcap_file(target, profile="ros2", compression="zstd") as file:
        topics = {topic.name: topic for topic in recording.topics()}
        kept = list(recording.messages(set(topics)))
        time_ns = kept[-1 if behind else 0].log_time_ns

        def write_kept() -> None:
            for one in kept:
                topic = topics[one.topic]
                file.write(topic, recording.definition(topic.schema), one.log_time_ns, one.data)

        if behind:
            write_kept()
        for number in range(messages):
            if number == 0 or not again:
                first = number * frames
                children = {f"f{frame}": np.eye(4) for frame in range(first, first + frames)}
                data = maker.transforms("base", children, time_ns)
            file.write(TF, definition, time_ns, data)
        if not behind:
            write_kept()
    return target


@pytest.mark.parametrize(
    ("messages", "frames", "again", "says"),
    [
        (3, 5_000, False, f"/tf: more than {MAX_TRANSFORMS} transforms: the rest of tf is left out"),
        (1, 15_000, False, f"bytes of transforms is left out; at most {MAX_TRANSFORM_BYTES} are accepted"),
        (5, 5_000, True, f"/tf: more than {FEW_BYTES} bytes of transforms: the rest of tf is left out"),
    ],
)
def test_tf_beyond_its_limits_is_left_out_and_told(
    messages: int, frames: int, again: bool, says: str, drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert surveying.MAX_TRANSFORMS_BYTES == MAX_TRANSFORMS_BYTES == 8 * FEW_BYTES
    if again:
        monkeypatch.setattr(surveying, "MAX_TRANSFORMS_BYTES", FEW_BYTES)
    path = with_tf(drive, tmp_path / "tf.mcap", messages, frames, again=again)
    with open_recording(path) as recording:
        found = survey(recording)
    assert any(says in problem for problem in found.problems)
    assert len(found.transforms) <= MAX_TRANSFORMS + frames
    assert len(found.images) == 3


def test_transforms_that_no_rig_needs_are_not_decoded_behind_the_beginning(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_recording(drive) as recording:
        beginning = survey(recording)
    decoded = []
    decode = RosTransformsDecoder.transforms
    monkeypatch.setattr(RosTransformsDecoder, "transforms", lambda *of: decoded.append(of[1].topic) or decode(*of))
    with open_recording(with_tf(drive, tmp_path / "tf.mcap", 3, 5_000, behind=True)) as recording:
        assert len(rigs_in_force(recording, beginning).rigs) == 1
    assert decoded == ["/tf_static"]

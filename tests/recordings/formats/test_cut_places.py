"""A recording cut at each of fifty places: the frames before the cut come out as they were, and the cut is reported."""

from pathlib import Path

import pytest

from auditor.errors import RecordingError
from auditor.recordings import (
    Recording,
    find_rigs,
    open_recording,
    survey,
    synchronise,
    write_bag,
    write_db3,
    write_mcap,
)
from tests.making.forms import copy_bag
from tests.making.recorded_drives import make_frames, make_rig, rechunk, same_frame, split

RIG = make_rig(3)
FRAMES = make_frames(RIG, 40)
PLACES = 50
IN_ONE_CHUNK = 3
"""Frames that the chunk or page which the cut goes through may hold, and the one that it tears apart."""


def whole(kind: str, folder: Path) -> Path:
    if kind == "mcap":
        write_mcap(folder / "whole.mcap", RIG, FRAMES)
        rechunk(folder / "whole.mcap", folder / "a.mcap", chunk_bytes=20_000, compression="ZSTD")
        return folder / "a.mcap"
    if kind == "bag":
        write_bag(folder / "whole.bag", RIG, FRAMES)
        return copy_bag(folder / "whole.bag", folder / "a.bag", "lz4", 20_000)
    write_db3(folder / "whole", RIG, FRAMES)
    return folder / "whole" / "whole.db3"


def frames_of(recording: Recording) -> list[object]:
    known = survey(recording)
    stream = synchronise(recording, RIG, known)
    frames, skipped = split(stream)
    assert all(topic.adds_up for topic in stream.balance)
    assert recording.damage
    assert len(skipped) <= IN_ONE_CHUNK
    return frames


@pytest.mark.parametrize("kind", ["mcap", "bag", "db3"])
def test_frames_before_each_of_fifty_cuts_come_out(tmp_path: Path, kind: str) -> None:
    path = whole(kind, tmp_path)
    content = path.read_bytes()
    with open_recording(path) as recording:
        assert len(find_rigs(survey(recording))) == 1
    for place in range(1, PLACES + 1):
        at = len(content) * place // (PLACES + 1)
        cut = tmp_path / f"cut{path.suffix}"
        cut.write_bytes(content[:at])
        try:
            with open_recording(cut) as recording:
                if not {RIG.topic(sensor) for sensor in RIG.sensors} <= {t.name for t in recording.topics()}:
                    assert place <= IN_ONE_CHUNK
                    continue
                frames = frames_of(recording)
        except RecordingError:
            assert place <= IN_ONE_CHUNK
            continue
        assert len(frames) >= len(FRAMES) * place // (PLACES + 1) - IN_ONE_CHUNK
        # The last frame may lack what lay behind the cut.
        assert all(same_frame(a, b) for a, b in zip(frames[:-1], FRAMES, strict=False))

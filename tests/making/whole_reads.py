"""All frames of a recording of one rig, as it is read to its end."""

from pathlib import Path

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import FrameStream, find_rigs, open_recording, survey, synchronise


def frames_of(path: Path) -> tuple[Rig, list[Frame], FrameStream]:
    """The rig, its frames, and the stream they came from; all that was read is accounted for, and nothing damaged."""
    with open_recording(path) as recording:
        known = survey(recording)
        [rig] = find_rigs(known)
        stream = synchronise(recording, rig, known)
        frames = list(stream)
        assert recording.damage == ()
        assert all(topic.adds_up for topic in stream.balance)
    return rig, frames, stream

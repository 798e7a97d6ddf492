"""Reads all that a recording and a message offer, and collects the errors and the damage; counts what is read."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from auditor.errors import AuditorError
from auditor.model.frames import Frame, Message
from auditor.model.rig import Rig
from auditor.recordings import FrameStream, content, find_rigs, open_recording, survey, synchronise
from auditor.recordings.decoding import Decoders

MAX_DECODED = 20


@dataclass
class Outcome:
    """The number of messages read, and the reasons of all errors and damage."""

    messages: int = 0
    reasons: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """All reasons as one text."""
        return "; ".join(self.reasons)


def read_all(path: Path) -> Outcome:
    """Read messages, topics, ground truth, metadata, rigs and frames; only our own errors are caught."""
    outcome = Outcome()
    try:
        with open_recording(path) as recording:
            decoders = Decoders(recording.definition)
            for message in recording.messages():
                outcome.messages += 1
                if outcome.messages <= MAX_DECODED:
                    outcome.reasons += decode_all(message, decoders)
            outcome.reasons += map(str, (*recording.damage, *decoders.repairs))
            assert sum(recording.counts.values()) >= outcome.messages
            _try(lambda: (recording.clock, recording.metadata()), outcome.reasons)
            _try(recording.labels, outcome.reasons)
            known = survey(recording)
            outcome.reasons += known.problems
            for rig in find_rigs(known):
                stream = synchronise(recording, rig, known, colour=True)
                for _ in stream:
                    pass
                assert all(topic.adds_up for topic in stream.balance)
    except AuditorError as error:
        outcome.reasons.append(str(error))
    return outcome


def decode_all(message: Message, decoders: Decoders) -> list[str]:
    """Decode all that a message may hold; returns the reasons of what was refused."""
    reasons: list[str] = []
    decoder = decoders.of(message.schema, message.encoding)
    if decoder is None:
        return reasons
    if decoder.kind != "transforms":
        _try(lambda: decoder.header(message), reasons)
    if decoder.kind == "image":
        _try(lambda: decoder.size_px(message), reasons)
        _try(lambda: decoder.pixels(message, colour=True), reasons)
    elif decoder.kind == "cloud":
        _try(lambda: decoder.xyz_m(message), reasons)
    elif decoder.kind == "camera_info":
        _try(lambda: decoder.camera_info(message), reasons)
    else:
        _try(lambda: decoder.transforms(message), reasons)
    return reasons


def _try(read: Callable[[], object], reasons: list[str]) -> None:
    try:
        read()
    except AuditorError as error:
        reasons.append(str(error))


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


def count_reads(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The bytes of each read from now on."""
    read: list[int] = []
    plain = content._pread

    def counted(descriptor: int, offset: int, length: int) -> bytes:
        read.append(length)
        return plain(descriptor, offset, length)

    monkeypatch.setattr(content, "_pread", counted)
    return read

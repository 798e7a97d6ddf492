"""Whatever can be asked of a recording and of a message, with what was answered."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from auditor.errors import AuditorError
from auditor.model.frames import Message
from auditor.recordings import find_rigs, open_recording, survey, synchronise
from auditor.recordings.decoding import Decoders

MAX_DECODED = 20


@dataclass
class Outcome:
    """How many messages came, and everything that was said about what did not."""

    messages: int = 0
    reasons: list[str] = field(default_factory=list)

    @property
    def told(self) -> str:
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
            outcome.reasons += map(str, recording.damage)
            assert sum(recording.counts.values()) >= outcome.messages
            _ask(lambda: (recording.clock, recording.metadata()), outcome.reasons)
            _ask(recording.labels, outcome.reasons)
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
    """Decode all that a message may hold; what was refused and why."""
    reasons: list[str] = []
    decoder = decoders.of(message.schema, message.encoding)
    if decoder is None:
        return reasons
    if decoder.kind != "transforms":
        _ask(lambda: decoder.header(message), reasons)
    if decoder.kind == "image":
        _ask(lambda: decoder.size_px(message), reasons)
        _ask(lambda: decoder.pixels(message, colour=True), reasons)
    elif decoder.kind == "cloud":
        _ask(lambda: decoder.xyz_m(message), reasons)
    elif decoder.kind == "camera_info":
        _ask(lambda: decoder.camera_info(message), reasons)
    else:
        _ask(lambda: decoder.transforms(message), reasons)
    return reasons


def _ask(question: Callable[[], object], reasons: list[str]) -> None:
    try:
        question()
    except AuditorError as error:
        reasons.append(str(error))

"""How much of what a recording holds of its sensors was audited, and what counts against it."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from auditor.model.stamps import NANOSECONDS

_MOST_NAMED = 6  # sensors or topics in one line
_DECLARED = "declared by --no-sensor to be neither camera nor LiDAR"


class TopicState(StrEnum):
    """What became of a topic. What is no sensor's is shown by `auditor inspect` and not kept."""

    READ = "read"
    UNREADABLE = "unreadable"
    NOT_COMPARED = "not compared"
    LEFT_OUT = "left out"
    NO_SENSOR = "no sensor"


UNAUDITED = frozenset({TopicState.UNREADABLE, TopicState.NOT_COMPARED})
"""States of a sensor's topic that leave a recording incomplete."""


class Against(StrEnum):
    """Why a message counts against the coverage of its sensor."""

    STANDS_STILL = "clock stands still"
    REPEATED = "stamp repeated"
    BACK = "stamp goes back"
    NOT_POSITIVE = "stamp zero or negative"
    DISAGREES = "stamp disagrees with its log time"
    LATE = "late"
    UNPAIRED = "unpaired"
    DAMAGED = "damaged"
    SAME_DATA = "same data"
    FEWER_RETURNS = "far fewer returns"


_MANY: Mapping[str, str] = {
    Against.STANDS_STILL: "stamps of a clock that stands still (placed by their log times)",
    Against.REPEATED: "stamps repeated",
    Against.BACK: "stamps that go back",
    Against.NOT_POSITIVE: "stamps zero or negative",
    Against.DISAGREES: "stamps that disagree with their log times",
    Against.SAME_DATA: "messages with the data of the one before",
    Against.FEWER_RETURNS: "scans with far fewer returns than those just before",
}


@dataclass(frozen=True)
class TimeCoverage:
    """How much of a recording's time the regular used messages of one sensor cover, in ns.

    `late_ns` and `early_ns` are how much later than the recording it begins, and how much earlier it ends.
    """

    held_ns: int = 0
    covered_ns: int = 0
    late_ns: int = 0
    early_ns: int = 0
    gaps: int = 0
    longest_gap_ns: int = 0


@dataclass(frozen=True)
class TopicCoverage:
    """One topic of camera pictures or LiDAR points; `sensor` is its number in the rig, None where it is none of it.

    `regular` counts its messages that are in a frame by their own stamp, `against` those that count against the
    coverage, by reason. Exact duplicates, the surplus of a fast sensor and what lies at the edges of a recording are
    neither. `reason` says why a topic is unreadable or left out, `remedy` what to do about it.
    """

    topic: str
    schema: str
    kind: str
    state: TopicState
    sensor: int | None = None
    name: str = ""
    read: int = 0
    regular: int = 0
    against: Mapping[str, int] = field(default_factory=dict)
    time: TimeCoverage | None = None
    reason: str = ""
    remedy: str = ""

    @property
    def messages_share(self) -> float:
        """Share of the messages that count which were used regularly; 1 where none counts."""
        counted = self.regular + sum(self.against.values())
        return self.regular / counted if counted else 1.0

    @property
    def time_share(self) -> float:
        """Share of the recording's time that its regular messages cover; 1 where there is no time."""
        return self.time.covered_ns / self.time.held_ns if self.time and self.time.held_ns else 1.0


def with_shortfall(
    topics: Iterable[TopicCoverage], reason: Against, counts: Mapping[int, int]
) -> tuple[TopicCoverage, ...]:
    """The coverage where so many regular messages of a sensor, by its number, count against it for a reason."""

    def of_topic(topic: TopicCoverage) -> TopicCoverage:
        count = min(counts.get(topic.sensor, 0), topic.regular) if topic.sensor is not None else 0
        against = {**topic.against, str(reason): count}
        return replace(topic, regular=topic.regular - count, against=against) if count else topic

    return tuple(map(of_topic, topics))


def declared(topics: Iterable[TopicCoverage], no_sensors: Collection[str]) -> tuple[TopicCoverage, ...]:
    """The topics, those that a person declares to be no sensors left out in place of unreadable or not compared.

    A topic of the rig stays as it is.
    """
    return tuple(
        replace(one, state=TopicState.LEFT_OUT, reason=_DECLARED, remedy="")
        if one.topic in no_sensors and one.state in UNAUDITED and one.sensor is None
        else one
        for one in topics
    )


def least_covered(topics: Iterable[TopicCoverage]) -> tuple[float, float]:
    """The shares of messages and of time of the least covered sensor of the rig, each by itself."""
    read = [topic for topic in topics if topic.state is TopicState.READ]
    return (
        min((topic.messages_share for topic in read), default=1.0),
        min((topic.time_share for topic in read), default=1.0),
    )


def coverage_line(topics: Sequence[TopicCoverage]) -> str:
    """One line of all that counts against the coverage; empty where nothing does."""
    said = [(topic.name, "; ".join(_shortfalls(topic))) for topic in topics if topic.state is TopicState.READ]
    short = [(name, text) for name, text in said if text]
    if not short:
        return ""
    texts = [f"{name} {text}" for name, text in short]
    if 1 < len(short) == len(said) and len({text for _, text in short}) == 1:
        texts = [f"all sensors: {short[0][1]}"]
    messages, time = least_covered(topics)
    return f"coverage {_percent(messages)} of messages, {_percent(time)} of time: {_first(texts)}"


def unread_line(topics: Sequence[TopicCoverage]) -> str:
    """One line of the sensors that cannot be read, and what to install or convert; empty where there are none."""
    unread = [topic for topic in topics if topic.state is TopicState.UNREADABLE]
    if not unread:
        return ""
    texts = [
        f"{topic.topic} ({topic.kind}): {'; '.join(filter(None, (topic.reason, topic.remedy)))}" for topic in unread
    ]
    count = "1 sensor" if len(unread) == 1 else f"{len(unread)} sensors"
    return f"{count} cannot be read: {_first(texts)}"


def not_compared_line(topics: Sequence[TopicCoverage]) -> str:
    """One line of the sensors that can be read and that no rig compares; empty where there are none."""
    texts = [f"{one.topic} ({one.kind}): {one.reason}" for one in topics if one.state is TopicState.NOT_COMPARED]
    if not texts:
        return ""
    count = "1 sensor is" if len(texts) == 1 else f"{len(texts)} sensors are"
    return (
        f"{count} not compared with others: {_first(texts)}; place it by its camera info and tf or in a rig file "
        "(--rig), or give --no-sensor TOPIC where it need not be audited"
    )


def left_out_line(topics: Sequence[TopicCoverage]) -> str:
    """One line of the topics that are in no rig, and why; empty where there are none.

    Of two topics of one camera only one is audited, and no recording says which of them its vehicle used.
    """
    texts = [f"{one.topic}: {one.reason}" for one in topics if one.state is TopicState.LEFT_OUT]
    if not texts:
        return ""
    return f"{'1 topic is' if len(texts) == 1 else f'{len(texts)} topics are'} in no rig: {_first(texts)}"


def _shortfalls(topic: TopicCoverage) -> Iterator[str]:
    for reason, count in topic.against.items():
        yield f"{count} {_MANY.get(reason, reason)}"
    time = topic.time
    if time is None:
        return
    if time.held_ns and not time.covered_ns:
        if not topic.against:
            yield "has no message in any frame"
        return
    if time.late_ns:
        yield f"begins {_seconds(time.late_ns)} late"
    if time.early_ns:
        yield f"ends {_seconds(time.early_ns)} early"
    if time.gaps:
        longest = _seconds(time.longest_gap_ns)
        yield f"a gap of {longest}" if time.gaps == 1 else f"{time.gaps} gaps, the longest of {longest}"


def _first(texts: Sequence[str]) -> str:
    more = [f"and {len(texts) - _MOST_NAMED} more"] if len(texts) > _MOST_NAMED else []
    return "; ".join([*texts[:_MOST_NAMED], *more])


def _percent(share: float) -> str:
    # Rounded down: what is not complete never reads as 100 %.
    return f"{int(share * 1000) / 10:g} %"


def _seconds(time_ns: int) -> str:
    return f"{time_ns / NANOSECONDS:.1f} s"

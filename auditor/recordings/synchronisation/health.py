"""The health of a recording's sensors: the use of their messages, the time they cover, and their clock offsets."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from auditor.model.coverage import TopicCoverage
from auditor.model.frames import Frame, SensorState, Skipped, TopicBalance
from auditor.model.rig import Rig
from auditor.recordings.synchronisation.frames import FrameStream
from auditor.recordings.synchronisation.shared_read import in_turn


@dataclass(frozen=True)
class SensorHealth:
    """One sensor: the use of its messages, its offset to the leftmost camera, and its first and last frame's stamps."""

    balance: TopicBalance
    offset_ns: int
    present: int = 0
    first_ns: int | None = None
    last_ns: int | None = None


@dataclass(frozen=True)
class Health:
    """All frames of a recording, with one rig; `skipped` counts moments without a frame by reason.

    `coverage` is of each topic of camera pictures or LiDAR points, those outside the rig included; `undecoded` says
    which messages did not decode.
    """

    frames: int
    skipped: Mapping[str, int]
    clock_jumps: int
    period_ns: int
    first_ns: int | None
    sensors: Mapping[int, SensorHealth]
    coverage: tuple[TopicCoverage, ...] = ()
    undecoded: tuple[str, ...] = ()


def check_health(streams: Sequence[tuple[FrameStream, Rig]]) -> list[Health]:
    """Synchronise and decode all frames of some streams in turn, and return the health of each one's sensors."""
    checks = [_Check(rig) for _, rig in streams]
    for place, item in in_turn([stream for stream, _ in streams]):
        checks[place].take(item)
    return [check.health(stream) for check, (stream, _) in zip(checks, streams, strict=True)]


class _Check:
    """What the frames of one stream show of its sensors."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._frames = 0
        self._skipped: Counter[str] = Counter()
        self._seen: dict[int, list[int]] = {sensor: [] for sensor in rig.sensors}
        self._present: Counter[int] = Counter()

    def take(self, item: Frame | Skipped) -> None:
        if isinstance(item, Skipped):
            self._skipped[item.reason] += 1
            return
        self._frames += 1
        for sensor, presence in item.presence.items():
            if presence.state is SensorState.PRESENT:
                self._present[sensor] += 1
                stamps_ns = [*self._seen[sensor], item.stamp_ns]
                self._seen[sensor] = [min(stamps_ns), max(stamps_ns)]

    def health(self, stream: FrameStream) -> Health:
        balance = {topic.sensor: topic for topic in stream.balance if topic.sensor is not None}
        return Health(
            frames=self._frames,
            skipped=dict(sorted(self._skipped.items())),
            clock_jumps=stream.clock_jumps,
            period_ns=stream.timing.period_ns,
            first_ns=min((first for first, _ in filter(None, self._seen.values())), default=None),
            sensors={
                sensor: SensorHealth(
                    balance.get(sensor, TopicBalance(self._rig.topic(sensor), "", sensor)),
                    stream.timing.offset_ns[sensor],
                    self._present[sensor],
                    *self._seen[sensor],
                )
                for sensor in self._rig.sensors
            },
            coverage=stream.coverage,
            undecoded=stream.undecoded,
        )

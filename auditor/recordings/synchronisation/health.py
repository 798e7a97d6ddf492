"""The health of a recording's sensors: the use of their messages, the time they cover, and their clock offsets."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from auditor.model.coverage import TopicCoverage
from auditor.model.frames import SensorState, Skipped, TopicBalance
from auditor.model.rig import Rig
from auditor.recordings.synchronisation.frames import FrameStream


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

    `coverage` is of each topic of camera pictures or LiDAR points, those outside the rig included.
    """

    frames: int
    skipped: Mapping[str, int]
    clock_jumps: int
    period_ns: int
    first_ns: int | None
    sensors: Mapping[int, SensorHealth]
    coverage: tuple[TopicCoverage, ...] = ()


def check_health(stream: FrameStream, rig: Rig) -> Health:
    """Synchronise and decode all frames, and return the health of the sensors."""
    frames = 0
    skipped: Counter[str] = Counter()
    seen: dict[int, list[int]] = {sensor: [] for sensor in rig.sensors}
    present: Counter[int] = Counter()
    for item in stream:
        if isinstance(item, Skipped):
            skipped[item.reason] += 1
            continue
        frames += 1
        for sensor, presence in item.presence.items():
            if presence.state is SensorState.PRESENT:
                present[sensor] += 1
                seen[sensor] = [min([*seen[sensor], item.stamp_ns]), max([*seen[sensor], item.stamp_ns])]
    balance = {topic.sensor: topic for topic in stream.balance if topic.sensor is not None}
    return Health(
        frames=frames,
        skipped=dict(sorted(skipped.items())),
        clock_jumps=stream.clock_jumps,
        period_ns=stream.timing.period_ns,
        first_ns=min((first for first, _ in filter(None, seen.values())), default=None),
        sensors={
            sensor: SensorHealth(
                balance.get(sensor, TopicBalance(rig.topic(sensor), "", sensor)),
                stream.timing.offset_ns[sensor],
                present[sensor],
                *seen[sensor],
            )
            for sensor in rig.sensors
        },
        coverage=stream.coverage,
    )

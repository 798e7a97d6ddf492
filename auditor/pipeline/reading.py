"""Whether a recording was read whole: decided here alone, so that every verb ends in the same exit code."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.identification.paper import listed
from auditor.model.checks import conflict_pairs, lies_too_close
from auditor.model.coverage import (
    TopicCoverage,
    coverage_line,
    declared,
    least_covered,
    left_out_line,
    not_compared_line,
    unread_line,
)
from auditor.model.frames import SensorState, TopicBalance
from auditor.model.optics.common_view import compared_shares
from auditor.model.rig import LIDAR, Rig
from auditor.model.settings import Criteria
from auditor.model.stamps import NANOSECONDS
from auditor.model.text import enumerated, first_few
from auditor.model.verdict import VerdictKind
from auditor.recordings.synchronisation.counts import BETWEEN, EDGE
from auditor.store.records import StoredJudgement, StoredMeasurement
from auditor.store.store import Store
from auditor.store.tables import read_table

_MOST_DAMAGE = 3  # pieces of damage in one remark
_MOST_FASTER = 3  # sensors in one remark
_MOST_WITHOUT = 6  # sensors in one remark
_MANY_BETWEEN = 1 / 3  # of a sensor's messages


@dataclass(frozen=True)
class FrameCount:
    """Frames that were put together, and moments without one by reason."""

    measured: int
    skipped: Mapping[str, int]

    @property
    def due(self) -> int:
        """Frames that the recording should give: those at its edges are not."""
        return self.measured + sum(self.skipped.values()) - self.skipped.get(EDGE, 0)


@dataclass(frozen=True)
class Reading:
    """What of a recording was not read, one sentence a piece, and whether that is little enough to be complete."""

    remarks: tuple[str, ...]
    complete: bool


def judge_reading(
    frames: FrameCount,
    coverage: Sequence[TopicCoverage] | None,
    balance: Sequence[TopicBalance],
    damage: Sequence[str],
    min_coverage: float = Criteria.min_coverage,
    no_sensors: Collection[str] = (),
) -> Reading:
    """Judge what was read of a recording with one rig; `coverage` is None where it was not kept.

    `no_sensors` are the names of topics that a person declares to be neither cameras nor LiDARs.

    It is incomplete where the least covered sensor, or the frames, fall short of `min_coverage`, where a sensor cannot
    be read or is not compared with others, and where anything is damaged.
    """
    topics = declared(coverage or (), no_sensors)
    messages, time = least_covered(topics)
    unread, not_compared = unread_line(topics), not_compared_line(topics)
    damaged = sum(topic.damaged for topic in balance)
    lost = f"damaged: {'; '.join(damage[:_MOST_DAMAGE]) or f'{damaged} damaged messages'}" if damage or damaged else ""
    enough = min(messages, time) >= min_coverage and frames.measured >= min_coverage * frames.due
    return Reading(
        tuple(
            filter(None, (coverage_line(topics), unread, not_compared, left_out_line(topics), lost, _between(balance)))
        ),
        enough and not unread and not not_compared and not lost,
    )


def _between(balance: Sequence[TopicBalance]) -> str:
    """Which sensors are faster than frames are, so that some of what they recorded is in none; empty where none is."""
    faster = [
        f"{topic.topic} {between} of {topic.read}"
        for topic in balance
        if topic.sensor is not None and (between := topic.skipped.get(BETWEEN, 0)) >= _MANY_BETWEEN * topic.read
    ]
    told = first_few(faster, _MOST_FASTER)
    return told and f"messages between frames, which the slowest sensor sets, are not looked at: {told}"


def reading_of(
    measurement: StoredMeasurement, min_coverage: float = Criteria.min_coverage, no_sensors: Collection[str] = ()
) -> Reading:
    """Whether the recording of a measurement was read whole."""
    frames = FrameCount(measurement.measured, measurement.skipped)
    damage = measurement.damage
    return judge_reading(frames, measurement.coverage, measurement.balance, damage, min_coverage, no_sensors)


def views_not_compared(
    rig: Rig, min_view: float, no_sensors: Collection[str] = (), beside: Sequence[Rig] = ()
) -> Iterator[str]:
    """The cameras of a rig of whose pictures no other camera is compared with a share of `min_view`.

    And a LiDAR that no pair of cameras is wide enough to check; and LiDARs alone, unless their topics are declared to
    be no sensors, or one of several is compared with cameras in a rig `beside` it: of one nothing is seen that is there
    all along, of several what stands where another one looks too.
    """
    seen = {one.lidar.topic for one in beside if one.cameras and one.lidar} if rig.others else set()
    lidars = [] if rig.cameras else [one for one in rig.sensors if rig.topic(one) not in {*no_sensors, *seen}]
    if rig.others and min_view > 0 and lidars:
        named, several = enumerated([f"S_{one} {rig.name(one)}" for one in lidars]), len(lidars) > 1
        whose, own, they = ("each other's", "their", "they see") if several else ("another LiDAR's", "its", "it sees")
        yield (
            f"{named}: compared with {whose} points where both look, and else looked at for what appears, by {own} "
            f"own past alone; no camera of this rig sees what {they}"
        )
    elif min_view > 0 and lidars:
        yield (
            f"S_0 {rig.name(LIDAR)} is looked at for what appears, by its own past alone: it is compared with no "
            "camera and no other LiDAR (where it should be, auditor inspect says what is missing)"
        )
    if min_view > 0 and checked_by_past(rig, beside):
        yield (
            f"S_0 {rig.name(LIDAR)} is checked by each camera's own past alone: "
            f"{listed([camera.number for camera in rig.cameras])} lie too close together to check its ranges"
        )
    for number, share in compared_shares(rig).items():
        if rig.by_time and max(share, _share_beside(rig.topic(number), beside)) < min_view:
            yield (
                f"S_{number} {rig.name(number)} is looked at for light by its own past alone, hardly straight ahead "
                "and not in the sky: no other camera sees it"
            )
        elif not rig.by_time and share < min_view:
            yield (
                f"S_{number} {rig.name(number)}: {100 * share:.0f} % of its picture is compared with another "
                f"camera's, and {100 * min_view:.0f} % are asked for (--min-view)"
            )


def checked_by_past(rig: Rig, beside: Sequence[Rig]) -> bool:
    """Whether cameras lie too close together to check their LiDAR, and each does it by its own past `beside` them."""
    lone = {one.camera(1).topic for one in beside if one.n == 1}
    return lies_too_close(rig) and all(camera.topic in lone for camera in rig.cameras)


def looks_again(rig: Rig, beside: Sequence[Rig]) -> bool:
    """Whether a camera's past names what rigs `beside` it find: it adds findings, and nothing is missing without it."""
    return rig.n == 1 and any(rig.topic(1) in map(one.topic, one.sensors) for one in beside if conflict_pairs(one))


def _share_beside(topic: str, beside: Sequence[Rig]) -> float:
    """The largest share of a camera's picture that one of several rigs compares with another camera's."""
    shares = (compared_shares(one)[camera.number] for one in beside for camera in one.cameras if camera.topic == topic)
    return max(shares, default=0.0)


def why_not_compared(rig: Rig) -> str:
    """What could not be done with frames of a rig in which nothing was compared, and the likely reason."""
    if not rig.cameras:
        return "could the LiDAR be compared with its scan before: scans too far apart in time, or of different places"
    if rig.by_time:
        return "could the LiDAR be compared with the camera's own past: the vehicle stands, or too little texture"
    return "could three sensors be compared: too little texture"


def frames_not_audited(
    store: Store,
    measurement: StoredMeasurement,
    judgement: StoredJudgement,
    min_coverage: float,
    rig: Rig,
    beside: Sequence[Rig],
) -> Iterator[str]:
    """Whether too few frames of a recording could be judged, and why where verdicts are withheld.

    Sensors of which some of them have nothing are named. None is too few of a rig that rigs `beside` it stand in for.
    """
    if measurement.withheld:
        yield f"verdicts withheld: {measurement.withheld}"
    audited = sum(count for kind, count in judgement.counts.items() if kind is not VerdictKind.NOT_AUDITABLE)
    due = FrameCount(measurement.measured, measurement.skipped).due
    if audited < min_coverage * due and not (checked_by_past(rig, beside) or looks_again(rig, beside)):
        without = first_few(list(_without(store, measurement, rig)), _MOST_WITHOUT)
        why = f": nothing of {without}" if without else "" if measurement.withheld else _most_frequent(store, judgement)
        yield f"{audited} of {due} frames audited{why}"


def _most_frequent(store: Store, judgement: StoredJudgement) -> str:
    """The most frequent reason why nothing is said of frames, and of how many; empty where there is none."""
    verdicts = read_table("verdicts", store.source("verdicts", judgement.judgement_id), ["kind", "reason"]).to_pylist()
    told = Counter(row["reason"] for row in verdicts if row["kind"] == VerdictKind.NOT_AUDITABLE and row["reason"])
    return "".join(f"; {count} other{'s' * (count > 1)}: {reason}" for reason, count in told.most_common(1))


def _without(store: Store, measurement: StoredMeasurement, rig: Rig) -> Iterator[str]:
    """The sensors of which some frames have nothing, and which frames; seconds are since the first frame."""
    frames = store.load_statistics(measurement.measurement_id)
    for sensor, states in zip(rig.sensors, frames.states.T, strict=True):
        places = np.flatnonzero(states != SensorState.PRESENT)
        if places.size:
            first = places[0]
            since_s = (frames.stamps_ns[first] - frames.stamps_ns[0]) / NANOSECONDS
            which = "frame" if places.size == 1 else f"{places.size} frames, the first"
            yield f"{rig.name(sensor)} in {which} {frames.frames[first]} ({since_s:.1f} s)"

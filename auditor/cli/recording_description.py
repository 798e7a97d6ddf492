"""What a recording holds, as `auditor inspect --format json` prints it: topics, health, rigs and what they identify."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from auditor.cli.capabilities import capabilities, short_pairs
from auditor.errors import RigError
from auditor.model.coverage import TopicCoverage, declared, unread_line
from auditor.model.optics.common_view import compared_shares, measured_view
from auditor.model.rig import MOST_OFF_PX, Camera, Rig
from auditor.model.rig_kind import RigKind
from auditor.model.settings import Criteria
from auditor.model.text import storable
from auditor.pipeline.geometry import (
    FirstFrames,
    RigDoubts,
    first_frames_of,
    rigs_of,
    rigs_through,
    rigs_to_begin_with,
)
from auditor.pipeline.reading import (
    FrameCount,
    Reading,
    judge_reading,
    looks_again,
    views_not_compared,
    why_not_compared,
)
from auditor.recordings import (
    Changes,
    FarAheadError,
    Health,
    Location,
    Recording,
    RigInForce,
    RigsInForce,
    Survey,
    check_health,
    open_recording,
    outside_topics,
    rig_places,
    search_rigs,
    share_a_read,
    survey,
    synchronise,
    unused_lidars,
    write_rig,
)
from auditor.reporting.rig_picture import rig_picture
from auditor.reporting.rig_plan import PlacedRig, UnusedLidar


def describe(
    where: Location,
    shown: Path | None,
    written: Path | None,
    no_sensors: Collection[str] = (),
    pictured: Path | None = None,
) -> dict[str, Any]:
    """Read a recording through, with the rig file `shown` in place of its own; its first rig is written to `written`.

    A picture of its rigs from above is written to `pictured`.

    `no_sensors` are topics that a person declares to be neither cameras nor LiDARs.

    Raises RecordingError where it cannot be read, RigError where the rig file does not fit it.
    """
    with open_recording(where) as recording:
        surveyed = survey(recording)
        looked = _Inspection(RigsInForce(()), [], [])
        missing = ""
        try:
            looked = _looked_through(recording, surveyed, shown)
        except RigError as error:
            if shown:
                raise
            missing = str(error)
        in_force, first, health = looked
        rigs = tuple(one.rig for one in in_force.rigs)
        if rigs and written:
            write_rig(rigs[0], written)
        if rigs and pictured:
            pictured.write_text(_picture(surveyed, rigs, no_sensors), encoding="utf-8")
        if not rigs:
            for _ in recording.messages(()):  # reads everything, so that counts and damage are complete
                pass
        damage = [str(piece) for piece in recording.damage]
        readings = [
            _reading(rig, one, seen, damage, no_sensors, rigs)
            for rig, one, seen in zip(rigs, health, first, strict=True)
        ]
        coverage = declared(_coverage(recording, surveyed, rigs, health), no_sensors)
        return {
            "recording": storable(str(where)),
            "recording_id": recording.recording_id,
            "clock": recording.clock,
            "metadata": dict(recording.metadata()),
            "labels": len(recording.labels()),
            "topics": list(_topics(recording, rigs, coverage)),
            "damage": damage,
            "problems": [*where.remarks, *in_force.remarks, *_without_cameras(surveyed), *surveyed.problems],
            "rigs": [
                {**_rig(rig, one), **_doubts(seen.doubts), "reading": list(reading.remarks)}
                for rig, one, seen, reading in zip(rigs, health, first, readings, strict=True)
            ],
            "unreadable": unread_line(coverage),
            "left_out": list(search_rigs(surveyed).reasons) if rigs and not shown else [],
            "missing": missing,
            "complete": bool(rigs)
            and all(one.complete for one in readings)
            and not any(seen.doubts.withheld for seen in first),
        }


def kinds_of_rigs(where: Location, rig_file: Path | None = None) -> tuple[RigKind, ...]:
    """The kinds of the rigs at a recording's beginning; none of one that says when it was attacked.

    Raises RecordingError where it cannot be read, RigError where it has no rig.
    """
    with open_recording(where) as recording:
        rigs = () if recording.labels() else rigs_of(survey(recording), rig_file)
        return tuple(rig.kind for rig in rigs)


def _without_cameras(surveyed: Survey) -> Iterator[str]:
    """What a recording of LiDARs lacks to be compared with cameras."""
    if surveyed.clouds and not surveyed.images and not any(one.kind == "camera" for one in surveyed.unreadable):
        yield (
            "it holds no pictures of cameras: give the file that does, too; both are read as one recording where they "
            "lie in one folder, cover the same time, and tf connects the LiDAR with the cameras"
        )


def _picture(surveyed: Survey, rigs: Sequence[Rig], no_sensors: Collection[str]) -> str:
    """The rigs from above, with the LiDARs that none of them has."""
    placed = [
        PlacedRig(rig, place) for rig, place in zip(rigs, rig_places(surveyed, rigs), strict=True) if place is not None
    ]
    unused = [UnusedLidar(name, at) for name, at in unused_lidars(surveyed, rigs, no_sensors).items()]
    return rig_picture(placed, unused)


class _Inspection(NamedTuple):
    """The rigs of a recording, and what each shows: its first frames, and the health of its sensors."""

    found: RigsInForce
    first: list[FirstFrames]
    health: list[Health]


def _looked_through(recording: Recording, surveyed: Survey, shown: Path | None) -> _Inspection:
    """Look at all frames, by the last read of the recording; calibrations that change are found meanwhile.

    Raises RigError.
    """
    beginning = rigs_to_begin_with(recording, surveyed) if shown is None else None
    if beginning is not None:
        rigs, changes = beginning
        looked = _looked_by(recording, rigs, changes)
        if not changes.any:
            return looked
    return _looked_by(recording, rigs_through(recording, surveyed, shown))


def _looked_by(recording: Recording, rigs: RigsInForce, changes: Changes | None = None) -> _Inspection:
    first: dict[str, FirstFrames] = {}
    for in_force in rigs.rigs:
        larger = (first[rig.rig_id].doubts.withheld for rig in rigs.larger_than(in_force) if rig.rig_id in first)
        first[in_force.rig.rig_id] = first_frames_of(
            recording, in_force, rigs.withheld or next(filter(None, larger), "")
        )
    return _Inspection(rigs, list(first.values()), _health_of(recording, rigs.rigs, changes))


def _health_of(recording: Recording, rigs: Sequence[RigInForce], changes: Changes | None) -> list[Health]:
    """The health of each rig's sensors: by one read, where the rigs can share it."""
    if len(rigs) == 1 or all(one.reads_along for one in rigs):
        streams = [synchronise(recording, one.rig, one.survey, stretches=one.stretches) for one in rigs]
        if rigs[0].survey.interleaved:
            share_a_read(recording, streams, [] if changes is None else [changes])
        with suppress(FarAheadError):
            return check_health([(stream, one.rig) for stream, one in zip(streams, rigs, strict=True)])
    return [health for one in rigs for health in _health_of(recording, [one], changes)]


def _coverage(
    recording: Recording, surveyed: Survey, rigs: Sequence[Rig], health: Sequence[Health]
) -> tuple[TopicCoverage, ...]:
    """What became of every topic with messages: by the first rig, or as far as that can be said without one."""
    if not health:
        return outside_topics(recording, surveyed)
    of_rig = tuple(one for one in health[0].coverage if one.sensor is not None)
    held_s = max((one.time.held_ns for one in of_rig if one.time), default=0) / 1e9
    return of_rig + outside_topics(recording, surveyed, rigs[0], held_s)


def _doubts(doubts: RigDoubts) -> dict[str, Any]:
    return {**doubts._asdict(), "withheld": doubts.withheld or None}


def _reading(
    rig: Rig, health: Health, first: FirstFrames, damage: list[str], no_sensors: Collection[str], rigs: Sequence[Rig]
) -> Reading:
    """What was not read with one of the rigs. Where none of its first frames can be compared, no scan judges them."""
    balance, frames = [one.balance for one in health.sensors.values()], FrameCount(health.frames, health.skipped)
    reading = judge_reading(frames, health.coverage, balance, (*damage, *health.undecoded), no_sensors=no_sensors)
    if narrow := tuple(views_not_compared(rig, Criteria.min_view, no_sensors, rigs)):
        reading = Reading((*reading.remarks, *narrow), complete=False)
    if first.compared or not first.measured or looks_again(rig, rigs):
        return reading
    dark = f"in none of {first.measured} frames at its beginning {why_not_compared(rig)}"
    return Reading((*reading.remarks, dark), complete=False)


def _topics(
    recording: Recording, rigs: tuple[Rig, ...], coverage: tuple[TopicCoverage, ...]
) -> Iterator[dict[str, Any]]:
    """Every topic, with its sensor, its state and, where it is not read, why, and what to do."""
    sensors = {rig.topic(sensor): f"S_{sensor}" for rig in rigs for sensor in rig.sensors}
    covered = {(one.topic, one.schema): one for one in coverage}
    traffic = recording.traffic
    # A name with messages of two types is two topics.
    for topic in sorted({*recording.topics(), *traffic}, key=lambda topic: (topic.name, topic.schema)):
        messages = traffic[topic].messages if topic in traffic else 0
        sensor, topic_coverage = sensors.get(topic.name), covered.get((topic.name, topic.schema))
        yield {
            "topic": topic.name,
            "schema": topic.schema,
            "messages": messages,
            "sensor": sensor,
            "state": _state(sensor, topic_coverage, messages),
            "why": topic_coverage.reason if topic_coverage is not None and sensor is None else "",
            "remedy": topic_coverage.remedy if topic_coverage is not None and sensor is None else "",
        }


def _state(sensor: str | None, covered: TopicCoverage | None, messages: int) -> str:
    """What became of a topic: what nothing else is said of was read for its calibrations or transforms."""
    if covered is None or (sensor is not None and covered.sensor is None):
        return "read" if sensor or messages else "empty"
    return covered.state.value


def _rig(rig: Rig, health: Health) -> dict[str, Any]:
    view = measured_view(rig)
    measured_in = None if view is None else {"size_px": _size(view.rig.cameras[0]), "focal_px": view.focal_px}
    compared = compared_shares(rig)
    sensors: list[dict[str, Any]] = [
        {"sensor": f"S_{number}", "name": lidar.name, "topic": lidar.topic} for number, lidar in rig.lidars.items()
    ]
    sensors += [
        {
            "sensor": f"S_{camera.number}",
            "name": camera.name,
            "topic": camera.topic,
            "size_px": _size(camera),
            "compared_share": compared[camera.number],
            "focal_px": camera.focal_px,
            "baseline_m": rig.baseline_m(camera.number, rig.n) if camera.number != rig.n else None,
            "reference": camera.number in rig.references,
        }
        for camera in rig.cameras
    ]
    return {
        "rig_id": rig.rig_id,
        "kind": str(rig.kind),
        "clouds_a_sweep": rig.lidar.sweep.parts if rig.lidar and rig.lidar.sweep else None,
        "beside_line_px": {} if rig.shares_view else _beside_line(rig),
        "rectified_to": None if rig.is_rectified else measured_in,
        "enlarged_to": measured_in if rig.is_rectified else None,
        "triples": [list(triple) for triple in rig.triples],
        "max_attacked": rig.max_attacked,
        "capabilities": capabilities(rig),
        "pairs_without_depth": [list(pair) for pair in short_pairs(rig)],
        "frames": health.frames,
        "skipped": dict(health.skipped),
        "clock_jumps": health.clock_jumps,
        "period_ms": health.period_ns / 1e6,
        "sensors": [
            {**sensor, **_sensor_health(health, number)} for sensor, number in zip(sensors, rig.sensors, strict=True)
        ],
    }


def _beside_line(rig: Rig) -> dict[str, float]:
    """By camera beside the line of the others how many rows it misses what is 10 m away."""
    return {f"S_{number}": off_px for number, off_px in rig.off_line_px.items() if off_px > MOST_OFF_PX}


def _size(camera: Camera) -> str:
    return f"{camera.width_px} x {camera.height_px}"


def _sensor_health(health: Health, sensor: int) -> dict[str, Any]:
    sensor_health = health.sensors[sensor]
    balance = sensor_health.balance
    covered = next(topic for topic in health.coverage if topic.sensor == sensor)
    return {
        "read": balance.read,
        "used": balance.used,
        "unused": balance.unused,
        "damaged": balance.damaged,
        "skipped": dict(sorted(balance.skipped.items())),
        "present": sensor_health.present,
        "from_s": None
        if sensor_health.first_ns is None or health.first_ns is None
        else (sensor_health.first_ns - health.first_ns) / 1e9,
        "to_s": None
        if sensor_health.last_ns is None or health.first_ns is None
        else (sensor_health.last_ns - health.first_ns) / 1e9,
        "offset_ms": sensor_health.offset_ns / 1e6,
        "messages_share": covered.messages_share,
        "time_share": covered.time_share,
        "against": dict(covered.against),
    }

"""`auditor inspect`: what is in a recording, whether it is whole, and which sensors can be audited."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options

if TYPE_CHECKING:
    from auditor.model.coverage import TopicCoverage
    from auditor.model.rig import Camera, Rig
    from auditor.pipeline.many import LimitsOf
    from auditor.pipeline.reading import Reading
    from auditor.recordings import Health, Location, Recording

_MOST_TOPICS_SHOWN = 200


@click.command("inspect", short_help="Topics, health, rigs and what they identify.")
@options.recordings_argument
@options.rig_option
@options.budget_options
@click.option("--write-rig", type=click.Path(path_type=Path), help="Write the rig to this rig.toml, to be corrected.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["table", "json"]),
    default="table",
    show_default=True,
    help="How it is printed.",
)
def command(
    recordings: tuple[Path, ...], rig: Path | None, limits: "LimitsOf", write_rig: Path | None, form: str
) -> int:
    """Read recordings through and show their topics, their health, the rigs in them and what these can identify.

    Where the messages of each sensor went adds up: read = used + unused + damaged + skipped. The exit code is that of
    a scan that finds nothing: 3 where not everything can be audited.

    \b
    auditor inspect night.mcap
    auditor inspect night.mcap --write-rig vehicle.toml
    auditor inspect night.mcap --rig vehicle.toml
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output import say  # noqa: PLC0415
    from auditor.cli.output_files import check_new  # noqa: PLC0415
    from auditor.errors import AuditorError, LimitError, SettingError  # noqa: PLC0415
    from auditor.pipeline.workers import run_within  # noqa: PLC0415
    from auditor.recordings import find_recordings  # noqa: PLC0415

    if write_rig:
        check_new(write_rig)
    found = find_recordings(recordings)
    if write_rig and len(found.recordings) > 1:
        raise SettingError(
            f"these are {len(found.recordings)} recordings, and each may have a rig of its own",
            where="--write-rig",
            remedy="name one of them",
        )
    tally = Tally()
    for error in found.errors:
        say(f"auditor: {error}")
        tally.failed = True
    descriptions = []
    for where in found.recordings:
        try:
            description = run_within(limits(where), _describe, where, rig, write_rig)
            if write_rig and description["rigs"]:
                say(f"the rig is in {write_rig}")
        except LimitError as error:
            say(f"auditor: {error}")
            tally.incomplete = True
            continue
        except AuditorError as error:
            say(f"auditor: {error}")
            tally.failed = True
            continue
        tally.audited |= bool(description["rigs"])
        tally.incomplete |= not description["complete"]
        descriptions.append(description)
        if form == "table":
            _show(description)
    if form == "json":
        click.echo(json.dumps(descriptions, indent=2))
    return tally.exit_code()


def _describe(where: "Location", shown: Path | None, written: Path | None) -> dict[str, Any]:
    from auditor.errors import RigError  # noqa: PLC0415
    from auditor.model.coverage import unread_line  # noqa: PLC0415
    from auditor.model.text import storable  # noqa: PLC0415
    from auditor.pipeline.measure import calibration_warnings_of, rigs_through  # noqa: PLC0415
    from auditor.recordings import (  # noqa: PLC0415
        RigsInForce,
        check_health,
        open_recording,
        outside_topics,
        search_rigs,
        survey,
        synchronise,
        write_rig,
    )

    with open_recording(where) as recording:
        surveyed = survey(recording)
        found = RigsInForce(())
        missing = ""
        try:
            found = rigs_through(recording, surveyed, shown)
        except RigError as error:
            if shown:
                raise
            missing = error.what
        rigs = tuple(one.rig for one in found.rigs)
        if rigs and written:
            write_rig(rigs[0], written)
        calibration_warnings = [calibration_warnings_of(recording, one) for one in found.rigs]
        health = [
            check_health(synchronise(recording, one.rig, one.survey, stretches=one.stretches), one.rig)
            for one in found.rigs
        ]
        if not rigs:
            for _ in recording.messages(()):  # reads everything, so that counts and damage are complete
                pass
        damage = [str(piece) for piece in recording.damage]
        readings = [_reading(one, damage) for one in health]
        coverage = health[0].coverage if health else outside_topics(recording, surveyed)
        return {
            "recording": storable(str(where)),
            "recording_id": recording.recording_id,
            "clock": recording.clock,
            "metadata": dict(recording.metadata()),
            "labels": len(recording.labels()),
            "topics": list(_topics(recording, rigs, coverage)),
            "damage": damage,
            "problems": [*found.remarks, *surveyed.problems],
            "rigs": [
                {**_rig(rig, one), "calibration_warnings": list(unfit), "reading": list(reading.remarks)}
                for rig, one, unfit, reading in zip(rigs, health, calibration_warnings, readings, strict=True)
            ],
            "unreadable": unread_line(coverage),
            "left_out": list(search_rigs(surveyed).reasons) if rigs and not shown else [],
            "missing": missing,
            "complete": bool(rigs) and all(reading.complete for reading in readings),
        }


def _reading(health: "Health", damage: list[str]) -> "Reading":
    from auditor.pipeline.reading import FrameCount, judge_reading  # noqa: PLC0415

    balance = [sensor.balance for sensor in health.sensors.values()]
    return judge_reading(FrameCount(health.frames, health.skipped), health.coverage, balance, damage)


def _topics(
    recording: "Recording", rigs: "tuple[Rig, ...]", coverage: "tuple[TopicCoverage, ...]"
) -> Iterator[dict[str, Any]]:
    """Every topic, with its sensor; those of cameras and LiDARs with their state and, where not read, why."""
    sensors = {rig.topic(sensor): f"S_{sensor}" for rig in rigs for sensor in rig.sensors}
    covered = {one.topic: one for one in coverage}
    counts = recording.counts
    for topic in recording.topics():
        yield {
            "topic": topic.name,
            "schema": topic.schema,
            "messages": counts.get(topic.name, 0),
            "sensor": sensors.get(topic.name),
            "state": _state(sensors.get(topic.name), covered.get(topic.name)),
            "why": covered[topic.name].reason if topic.name in covered and topic.name not in sensors else "",
        }


def _state(sensor: str | None, covered: "TopicCoverage | None") -> str | None:
    if covered is None or (sensor is not None and covered.sensor is None):
        return "read" if sensor else None
    return covered.state.value


def _rig(rig: "Rig", health: "Health") -> dict[str, Any]:
    from auditor.cli.capabilities import capabilities, short_pairs  # noqa: PLC0415
    from auditor.model.optics.common_view import common_view  # noqa: PLC0415

    leftmost = rig.cameras[-1]
    view = None if rig.is_rectified else common_view(rig)
    sensors: list[dict[str, Any]] = []
    if rig.lidar:
        sensors.append({"sensor": "S_0", "name": rig.lidar.name, "topic": rig.lidar.topic})
    sensors += [
        {
            "sensor": f"S_{camera.number}",
            "name": camera.name,
            "topic": camera.topic,
            "size_px": _size(camera),
            "focal_px": camera.focal_px,
            "baseline_m": rig.baseline_m(camera.number, leftmost.number) if camera is not leftmost else None,
            "reference": camera.number in rig.references,
        }
        for camera in rig.cameras
    ]
    return {
        "rig_id": rig.rig_id,
        "kind": str(rig.kind),
        "beside_line_px": {} if rig.shares_view else _beside_line(rig),
        "rectified_to": None if view is None else {"size_px": _size(view.rig.cameras[0]), "focal_px": view.focal_px},
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


def _beside_line(rig: "Rig") -> dict[str, float]:
    """By camera beside the line of the others how many rows it misses what is 10 m away."""
    from auditor.model.rig import MOST_OFF_PX  # noqa: PLC0415

    return {f"S_{number}": off_px for number, off_px in rig.off_line_px.items() if off_px > MOST_OFF_PX}


def _size(camera: "Camera") -> str:
    return f"{camera.width_px} x {camera.height_px}"


def _sensor_health(health: "Health", sensor: int) -> dict[str, Any]:
    one = health.sensors[sensor]
    balance = one.balance
    covered = next(topic for topic in health.coverage if topic.sensor == sensor)
    return {
        "read": balance.read,
        "used": balance.used,
        "unused": balance.unused,
        "damaged": balance.damaged,
        "skipped": dict(sorted(balance.skipped.items())),
        "present": one.present,
        "from_s": None if one.first_ns is None or health.first_ns is None else (one.first_ns - health.first_ns) / 1e9,
        "to_s": None if one.last_ns is None or health.first_ns is None else (one.last_ns - health.first_ns) / 1e9,
        "offset_ms": one.offset_ns / 1e6,
        "messages_share": covered.messages_share,
        "time_share": covered.time_share,
        "against": dict(covered.against),
    }


def _show(description: dict[str, Any]) -> None:
    from auditor.cli.output import print_rows, shown  # noqa: PLC0415

    click.echo(shown(f"{description['recording']}"))
    click.echo(shown(f"  clock {description['clock']}, sha256 {description['recording_id']}"))
    for name, value in description["metadata"].items():
        click.echo(shown(f"  {name}: {value}"))
    if description["labels"]:
        click.echo(shown(f"  carries ground truth of {description['labels']} attacks"))
    topics = sorted(description["topics"], key=lambda topic: topic["sensor"] is None)[:_MOST_TOPICS_SHOWN]
    print_rows(sorted(topics, key=lambda topic: topic["topic"]), ("topic", "schema", "messages", "sensor", "state"))
    if more := len(description["topics"]) - len(topics):
        click.echo(shown(f"  and {more} more topics: --format json lists all"))
    for rig in description["rigs"]:
        columns = ("sensor", "name", "topic", "size_px", "focal_px", "baseline_m", "reference")
        rows = [{column: sensor.get(column) for column in columns} for sensor in rig["sensors"]]
        print_rows(rows, columns, title=f"Rig {rig['kind']}")
        for line in rig["capabilities"]:
            click.echo(shown(f"  {line}"))
        click.echo()
        for line in _geometry(rig):
            click.echo(shown(f"  {line}") + "\n")
        counted = ("sensor", "read", "used", "unused", "damaged", "skipped", "present", "from_s", "to_s", "offset_ms")
        print_rows(
            [
                {column: sensor[column] if sensor[column] != {} else None for column in counted}
                for sensor in rig["sensors"]
            ],
            counted,
            title="Messages, presence, and offset to the leftmost camera",
        )
        click.echo(shown(f"  {_frames(rig)}") + "\n")
        for remark in rig["reading"]:
            click.echo(shown(f"  {remark}"))
    for remark in _remarks(description):
        click.echo(shown(f"  {remark}"))


def _remarks(description: dict[str, Any]) -> Iterator[str]:
    """What is to be said of the whole recording, one line a piece."""
    left_out = [topic for topic in description["topics"] if topic["state"] == "left out"]
    texts = [
        topic["why"] if topic["topic"] in topic["why"] else f"{topic['topic']}: {topic['why']}" for topic in left_out
    ]
    told = {topic["why"] for topic in left_out}
    for text in (*texts, *(reason for reason in description["left_out"] if reason not in told)):
        yield f"left out: {text}"
    if description["unreadable"] and not description["rigs"]:
        yield description["unreadable"]
    yield from description["problems"]
    for piece in description["damage"]:
        yield f"damaged: {piece}"
    if description["missing"]:
        yield description["missing"]


def _frames(rig: dict[str, Any]) -> str:
    lost = [f"{count} without enough sensors ({reason})" for reason, count in rig["skipped"].items()]
    jumps = [f"the clock jumped back {rig['clock_jumps']} times"] if rig["clock_jumps"] else []
    return "; ".join([f"{rig['frames']} frames, one each {rig['period_ms']:.0f} ms", *lost, *jumps])


def _geometry(rig: dict[str, Any]) -> Iterator[str]:
    if rig["rectified_to"]:
        size, focal = rig["rectified_to"]["size_px"], rig["rectified_to"]["focal_px"]
        shown = f"images of {size} px, focal length {focal:.0f} px"
        if rig["beside_line_px"]:
            beside = ", ".join(f"{name} by {rows:.1f} px" for name, rows in rig["beside_line_px"].items())
            yield f"not on one line ({beside} at 10 m): rectified pair by pair, and mapped to {shown}"
        else:
            yield f"not rectified as recorded: measured on rectified {shown}"
    for warning in rig["calibration_warnings"]:
        yield f"WARNING: {warning}"

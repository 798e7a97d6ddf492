"""`auditor inspect`: what is in a recording, whether it is whole, and which sensors can be audited."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options

if TYPE_CHECKING:
    from auditor.model.rig import Camera, Rig
    from auditor.recordings import Health, Recording


@click.command("inspect", short_help="Topics, health, rigs and what they identify.")
@options.recordings_argument
@options.rig_option
@click.option("--write-rig", type=click.Path(path_type=Path), help="Write the rig to this rig.toml, to be corrected.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["table", "json"]),
    default="table",
    show_default=True,
    help="How it is printed.",
)
def command(recordings: tuple[Path, ...], rig: Path | None, write_rig: Path | None, form: str) -> int:
    """Read recordings through and show their topics, their health, the rigs in them and what these can identify.

    Where the messages of each sensor went adds up: read = used + unused + damaged + skipped.

    \b
    auditor inspect night.mcap
    auditor inspect night.mcap --write-rig vehicle.toml
    auditor inspect night.mcap --rig vehicle.toml
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output import say  # noqa: PLC0415
    from auditor.cli.output_files import check_new  # noqa: PLC0415
    from auditor.errors import AuditorError, SettingError  # noqa: PLC0415
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
    for path in found.recordings:
        try:
            description = _describe(path, rig, write_rig)
        except AuditorError as error:
            say(f"auditor: {error}")
            tally.failed = True
            continue
        tally.audited |= bool(description["rigs"])
        tally.incomplete |= bool(description["damage"]) or not description["rigs"] or _has_damaged(description)
        descriptions.append(description)
        if form == "table":
            _show(description)
    if form == "json":
        click.echo(json.dumps(descriptions, indent=2))
    return tally.exit_code()


def _describe(path: Path, shown: Path | None, written: Path | None) -> dict[str, Any]:
    from auditor.cli.output import say  # noqa: PLC0415
    from auditor.errors import RigError  # noqa: PLC0415
    from auditor.model.text import storable  # noqa: PLC0415
    from auditor.pipeline.measure import calibration_warnings_of, rigs_of  # noqa: PLC0415
    from auditor.recordings import check_health, open_recording, search_rigs, survey, synchronise, write_rig  # noqa: PLC0415

    with open_recording(path) as recording:
        surveyed = survey(recording)
        rigs: tuple[Rig, ...] = ()
        missing = ""
        try:
            rigs = rigs_of(surveyed, shown)
        except RigError as error:
            if shown:
                raise
            missing = error.what
        if rigs and written:
            write_rig(rigs[0], written)
            say(f"the rig is in {written}")
        calibration_warnings = [calibration_warnings_of(recording, surveyed, rig) for rig in rigs]
        described = [
            {**_rig(rig, check_health(synchronise(recording, rig, surveyed), rig)), "calibration_warnings": list(unfit)}
            for rig, unfit in zip(rigs, calibration_warnings, strict=True)
        ]
        if not rigs:
            for _ in recording.messages(()):  # reads everything, so that counts and damage are complete
                pass
        return {
            "recording": storable(str(path)),
            "recording_id": recording.recording_id,
            "clock": recording.clock,
            "metadata": dict(recording.metadata()),
            "labels": len(recording.labels()),
            "topics": list(_topics(recording, rigs)),
            "damage": [str(piece) for piece in recording.damage],
            "problems": list(surveyed.problems),
            "rigs": described,
            "left_out": list(search_rigs(surveyed).reasons) if rigs and not shown else [],
            "missing": missing,
        }


def _has_damaged(description: dict[str, Any]) -> bool:
    return any(sensor["damaged"] for rig in description["rigs"] for sensor in rig["sensors"])


def _topics(recording: "Recording", rigs: "tuple[Rig, ...]") -> Iterator[dict[str, Any]]:
    sensors = {rig.topic(sensor): f"S_{sensor}" for rig in rigs for sensor in rig.sensors}
    for topic in recording.topics():
        yield {
            "topic": topic.name,
            "schema": topic.schema,
            "messages": recording.counts.get(topic.name, 0),
            "sensor": sensors.get(topic.name),
        }


def _rig(rig: "Rig", health: "Health") -> dict[str, Any]:
    from auditor.cli.capabilities import capabilities, short_pairs  # noqa: PLC0415
    from auditor.model.common_view import common_view  # noqa: PLC0415

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
    }


def _show(description: dict[str, Any]) -> None:
    from auditor.cli.output import print_rows, shown  # noqa: PLC0415

    click.echo(shown(f"{description['recording']}"))
    click.echo(shown(f"  clock {description['clock']}, sha256 {description['recording_id']}"))
    for name, value in description["metadata"].items():
        click.echo(shown(f"  {name}: {value}"))
    if description["labels"]:
        click.echo(shown(f"  carries ground truth of {description['labels']} attacks"))
    print_rows(description["topics"], ("topic", "schema", "messages", "sensor"))
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
    for reason in description["left_out"]:
        click.echo(shown(f"  left out: {reason}"))
    for remark in (*description["problems"], *(f"damaged: {piece}" for piece in description["damage"])):
        click.echo(shown(f"  {remark}"))
    if description["missing"]:
        click.echo(shown(f"  {description['missing']}"))


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

"""`auditor inspect`: what is in a recording, whether it is whole, and which sensors can be audited."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.options import PATH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from auditor.cli.exit_codes import Tally
    from auditor.pipeline.remote.addresses import Address
    from auditor.pipeline.workers import LimitsOf
    from auditor.recordings import Location

_MOST_TOPICS_SHOWN = 200


@click.command("inspect", short_help="Topics, health, rigs and what they identify.")
@options.recordings_argument
@options.setting("rig")
@options.setting("no_sensors")
@options.budget_options
@click.option("--write-rig", type=PATH, help="Write the rig to this rig.toml, to be corrected.")
@click.option("--picture", type=PATH, help="Draw the rigs from above into this SVG file.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["table", "json"]),
    default="table",
    show_default=True,
    help="How it is printed.",
)
def command(
    recordings: "tuple[Path | Address, ...]",
    rig: Path | None,
    no_sensors: tuple[str, ...],
    limits: "LimitsOf",
    write_rig: Path | None,
    picture: Path | None,
    form: str,
) -> int:
    """Read recordings through and show their topics, their health, the rigs in them and what these can identify.

    Each topic has a state: read (also for its calibrations or transforms), unreadable, left out, no sensor, or empty.
    Where the messages of each sensor went adds up: read = used + unused + damaged + skipped. The exit code is that of
    a scan that finds nothing: 3 where not everything can be audited.

    \b
    auditor inspect night.mcap
    auditor inspect night.mcap --write-rig vehicle.toml
    auditor inspect night.mcap --rig vehicle.toml
    auditor inspect night.mcap --picture vehicle.svg
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output import say  # noqa: PLC0415
    from auditor.cli.output_files import check_new  # noqa: PLC0415
    from auditor.cli.recording_description import describe  # noqa: PLC0415
    from auditor.errors import AuditorError, LimitError, SettingError  # noqa: PLC0415
    from auditor.pipeline.remote.spool import copies_of  # noqa: PLC0415
    from auditor.pipeline.workers import run_within  # noqa: PLC0415

    for written in filter(None, (write_rig, picture)):
        check_new(written)
    tally = Tally()
    located = _found(recordings, tally)
    if (write_rig or picture) and len(located) > 1:
        raise SettingError(
            f"these are {len(located)} recordings, and each may have a rig of its own",
            where="--write-rig" if write_rig else "--picture",
            remedy="name one of them",
        )
    descriptions = []
    for where in copies_of(located):
        try:
            if isinstance(where, AuditorError):
                raise where
            description = run_within(limits(where), describe, where, rig, write_rig, no_sensors, picture)
            if description["rigs"]:
                _say_written(write_rig, picture)
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


def _say_written(rig: Path | None, picture: Path | None) -> None:
    from auditor.cli.output import say  # noqa: PLC0415 - keeps --help quick

    for name, path in (("rig", rig), ("picture", picture)):
        if path:
            say(f"the {name} is in {path}")


def _found(recordings: "Sequence[Path | Address]", tally: "Tally") -> "tuple[Location, ...]":
    """The recordings at some places; what is none is said, and fails where it may have been one."""
    from auditor.cli.output import say  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.remote.finding import find_all  # noqa: PLC0415

    located = find_all(recordings)
    for note in located.notes:
        say(f"{note}: it is text and no recording, and was not read")
    for error in located.errors:
        say(f"auditor: {error}")
        tally.failed = True
    return located.recordings


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
            title=f"Messages, presence, and offset to {_base(rig)}",
        )
        click.echo(shown(f"  {_frames(rig)}") + "\n")
        for remark in rig["reading"]:
            click.echo(shown(f"  {remark}"))
    for remark in _remarks(description):
        click.echo(shown(f"  {remark}"))


def _base(rig: dict[str, Any]) -> str:
    """What the offsets of a rig's sensors are to."""
    last = rig["sensors"][-1]
    return "the leftmost camera" if last.get("size_px") else f"the LiDAR {last['sensor']}"


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
    yield from (problem for problem in description["problems"] if problem not in description["missing"])
    for piece in description["damage"]:
        yield f"damaged: {piece}"
    if description["missing"]:
        yield description["missing"]


def _frames(rig: dict[str, Any]) -> str:
    lost = [f"{count} without enough sensors ({reason})" for reason, count in rig["skipped"].items()]
    jumps = [f"the clock jumped back {rig['clock_jumps']} times"] if rig["clock_jumps"] else []
    return "; ".join([f"{rig['frames']} frames, one each {rig['period_ms']:.0f} ms", *lost, *jumps])


def _shown(view: dict[str, Any]) -> str:
    return f"images of {view['size_px']} px, focal length {view['focal_px']:.0f} px"


def _geometry(rig: dict[str, Any]) -> Iterator[str]:
    if rig["enlarged_to"]:
        yield f"of few pixels: measured on {_shown(rig['enlarged_to'])}, enlarged"
    if rig["rectified_to"]:
        shown = _shown(rig["rectified_to"])
        if rig["beside_line_px"]:
            beside = ", ".join(f"{name} by {rows:.1f} px" for name, rows in rig["beside_line_px"].items())
            yield f"not on one line ({beside} at 10 m): rectified pair by pair, and mapped to {shown}"
        else:
            yield f"not rectified as recorded: measured on rectified {shown}"
        cameras = (sensor for sensor in rig["sensors"] if "compared_share" in sensor)
        shares = (f"{camera['sensor']} {100 * camera['compared_share']:.0f} %" for camera in cameras)
        yield f"compared with other cameras, of each picture: {', '.join(shares)}"
    if rig["clouds_a_sweep"]:
        yield f"{rig['clouds_a_sweep']} clouds of {rig['sensors'][0]['name']} make one sweep, and are put together"
    if rig["withheld"]:
        yield f"verdicts are withheld: {rig['withheld']}"
    for warning in (*rig["calibration_warnings"], *rig["remarks"]):
        yield f"WARNING: {warning}"

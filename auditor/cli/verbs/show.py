"""`auditor show`: one frame of a recording, for people to look at."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.options import PATH
from auditor.cli.output import answer, print_rows, say

if TYPE_CHECKING:
    from auditor.model.frames import Frame
    from auditor.pipeline.pictures import ShownFrame
    from auditor.pipeline.workers import LimitsOf

_COLUMNS = ("sensor", "name", "topic", "state", "skew_ms", "data", "damaged")


@click.command("show", short_help="Any frame, with what is damaged in it.")
@click.argument("recording", type=PATH)
@click.argument("frame", type=click.IntRange(min=0))
@options.store_option
@options.setting("rig")
@options.budget_options
@click.option("--into", type=PATH, help="Write its pictures into this new folder, as PNG files.")
def command(recording: Path, frame: int, store: Path, rig: Path | None, limits: "LimitsOf", into: Path | None) -> int:
    """Show one frame of a recording: its sensors, its verdict, and pictures of all cameras and of the cloud.

    \b
    auditor show night.mcap 120
    auditor show night.mcap 120 --into frame_120

    Frames are numbered from 0, as in the store. Where the store has measured the recording, its verdict and its damaged
    portions are shown; otherwise the frame is measured now, and gets no verdict. Pictures are what each camera
    recorded, the same with what is damaged, the cloud from above and as a range image, and where poses were recorded
    and measured a sketch of the drive with the frame's place.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.casefile.folder import new_folder, write_file  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output_files import check_new  # noqa: PLC0415
    from auditor.model.frames import SkippedFrame  # noqa: PLC0415
    from auditor.pipeline.pictures import show_frame  # noqa: PLC0415
    from auditor.pipeline.workers import run_within  # noqa: PLC0415
    from auditor.recordings import Location  # noqa: PLC0415
    from auditor.reporting.sketch import sketch, track_of  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    if into is not None:
        check_new(into)
    kept = store if Store.is_at(store) else None
    where = Location(recording)
    shown = run_within(limits(where), show_frame, where, frame, kept, rig)
    if isinstance(shown.frame, SkippedFrame):
        say(f"{recording}: frame {frame} was skipped: {shown.frame.reason}")
        return Exit.INCOMPLETE
    _print(shown, shown.frame)
    if into is not None:
        track = track_of(Store.open(store), shown.measurement_id) if shown.measurement_id else None
        with new_folder(into) as folder:
            for picture in shown.pictures:
                write_file(folder / picture.name, picture.data)
            if track is not None:
                write_file(folder / f"{frame}.place.svg", sketch(track, frame, frame).encode())
        answer(f"{len(shown.pictures) + (track is not None)} pictures are in {into}")
    return Exit.CLEAN


def _print(shown: "ShownFrame", frame: "Frame") -> None:
    when = f"stamp {frame.stamp_ns} ns"
    if shown.clock == "utc":
        when += f", {datetime.fromtimestamp(frame.stamp_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f} UTC"
    rows = [_sensor(shown, frame, sensor) for sensor in shown.rig.sensors]
    print_rows(rows, _COLUMNS, f"frame {frame.number}, {when}")
    if shown.verdict is None:
        answer("no verdict: " + ("it was not judged" if shown.measurement_id else "the store has not measured it"))
    else:
        verdict = shown.verdict
        named = [f"S_{sensor}" for sensor in verdict["attacked"] or ()]
        gap = "" if verdict["gap"] is None else f", gap {verdict['gap']:.2f}"
        reason = f": {verdict['reason']}" if verdict["reason"] else ""
        answer(f"verdict {' '.join([verdict['kind'], ' + '.join(named)]).strip()}{gap}{reason}")


def _sensor(shown: "ShownFrame", frame: "Frame", sensor: int) -> dict[str, Any]:
    presence, data = frame.presence[sensor], None
    if sensor in frame.images:
        pixels = frame.images[sensor].pixels
        data = f"{pixels.shape[1]} x {pixels.shape[0]}{' colour' if pixels.ndim == 3 else ''}, mean {pixels.mean():.0f}"
    elif sensor in frame.clouds:
        data = f"{len(frame.clouds[sensor].xyz_m)} points"
    shares = [100 * region.share for region in shown.regions if region.sensor == sensor]
    return {
        "sensor": f"S_{sensor}",
        "name": shown.rig.name(sensor),
        "topic": shown.rig.topic(sensor),
        "state": presence.reason or presence.state.value,
        "skew_ms": None if presence.skew_ns is None else presence.skew_ns / 1e6,
        "data": data,
        "damaged": f"{shares[0]:.1f} %" if shares else None,
    }

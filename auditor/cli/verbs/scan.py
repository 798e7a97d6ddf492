"""`auditor scan`: the main job."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.output import format_option, say

if TYPE_CHECKING:
    from auditor.model.settings import Criteria, MeasureSettings
    from auditor.pipeline.remote.addresses import Address


@click.command("scan", short_help="Audit recordings: the main job.")
@options.recordings_argument
@options.store_option
@options.judging_options(*options.JUDGING)
@click.option("--measure-only", is_flag=True, help="Measure and keep; judge later with auditor judge.")
@options.measuring_options(*options.MEASURING, "shard", "engine", "address")
@format_option
def command(
    recordings: "tuple[Path | Address, ...]",
    store: Path,
    judging: "Criteria",
    measuring: "MeasureSettings",
    *,
    measure_only: bool,
    form: str,
) -> int:
    """Audit recordings: measure every frame, judge it, and name the attacked sensors.

    \b
    auditor scan fleet_logs/*.mcap
    auditor scan fleet_logs/ -r 0 --store night/audit

    auditor scan 's3://bucket/fleet/**/*.mcap'

    Files may be MCAP, ROS 1 .bag or ROS 2 .db3; folders may be rosbag2 folders, KITTI raw drives, or hold several of
    these. The parts of a split drive, given or found together, are one recording. What the store has measured already
    is not measured again, but with --measure-again. Files that are as they were when the store read them are not read
    again, but with --verify-content, and verdicts that would be the same are kept. The tables show what was judged now.

    Incidents that a review calls a false alarm, or known, do not fail a scan (auditor review): the exit code counts the
    others.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.logged import note_altered  # noqa: PLC0415
    from auditor.cli.summary import (  # noqa: PLC0415
        show_audit,
        show_judging,
        show_measuring,
        show_shard,
        show_unjudged,
    )
    from auditor.pipeline.library import judge_settings  # noqa: PLC0415
    from auditor.pipeline.many import find_batch  # noqa: PLC0415
    from auditor.pipeline.scan import Scan  # noqa: PLC0415
    from auditor.store.export import leave_pandas_out  # noqa: PLC0415

    leave_pandas_out()
    settings = judge_settings(store, judging)  # a wrong calibration is refused before hours of measuring
    batch = find_batch(recordings, store, measuring)
    scan, tally, judged = Scan(batch, store), Tally(), []
    with scan.logged() as entry:
        tally.incomplete = note_altered(scan.store if measuring.shard is None else None, entry)
        show_measuring(scan, tally)
        for superseded in scan.relate():
            say(superseded)
        if measuring.shard is not None:
            show_shard(measuring.shard, scan, tally)
        elif measure_only:
            show_unjudged(scan.measured, tally)
        else:
            judged = show_judging(scan.judge(settings), scan.store, tally)
        for remark in scan.finish():
            say(remark)
        if measuring.shard is not None:
            return tally.exit_code()
        show_known = batch.shows_known or form != "table"
        kept, measured = scan.store if scan.measured else None, scan.measured
        show_audit(kept, form, tally, judged, show_known=show_known, measured=measured)
    return tally.exit_code()

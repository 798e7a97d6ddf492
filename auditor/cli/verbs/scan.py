"""`auditor scan`: the main job."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import judging_options, options
from auditor.cli.logged import logged
from auditor.cli.output import format_option, say

if TYPE_CHECKING:
    from auditor.pipeline.many import MeasureSettings


@click.command("scan", short_help="Audit recordings: the main job.")
@options.recordings_argument
@options.store_option
@judging_options.judging_options
@click.option("--measure-only", is_flag=True, help="Measure and keep; judge later with auditor judge.")
@options.measuring_options
@format_option
def command(
    recordings: tuple[Path, ...],
    store: Path,
    measuring: "MeasureSettings",
    *,
    measure_only: bool,
    form: str,
    **judging: Any,  # noqa: ANN401 - handed on to judge_settings, which declares them
) -> int:
    """Audit recordings: measure every frame, judge it, and name the attacked sensors.

    \b
    auditor scan fleet_logs/*.mcap
    auditor scan fleet_logs/ -r 0 --store night/audit

    Files may be MCAP, ROS 1 .bag or ROS 2 .db3; folders may be rosbag2 folders, KITTI raw drives, or hold several of
    these. The parts of a split drive, given or found together, are one recording. What the store has measured already
    is not measured again, but with --measure-again. Files that are as they were when the store read them are not read
    again, but with --verify-content, and verdicts that would be the same are kept. The tables show what was judged now.

    Incidents that a review calls a false alarm, or known, do not fail a scan (auditor review): the exit code counts the
    others.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import NotAudited, Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.summary import show_audit, show_judging, show_measuring  # noqa: PLC0415
    from auditor.model.text import storable  # noqa: PLC0415
    from auditor.pipeline.ledger import keep_ledger  # noqa: PLC0415
    from auditor.pipeline.library import judge_settings  # noqa: PLC0415
    from auditor.pipeline.many import Judged, find_batch, judge_all  # noqa: PLC0415
    from auditor.pipeline.pictures.incident_pictures import picture_incidents  # noqa: PLC0415
    from auditor.store import Store  # noqa: PLC0415
    from auditor.store.maintenance.relations import relate  # noqa: PLC0415
    from auditor.store.packs.packing import pack_where_many  # noqa: PLC0415

    settings = judge_settings(store, **judging)  # a wrong calibration is refused before hours of measuring
    tally, judged = Tally(), list[Judged]()
    batch = find_batch(recordings, store, measuring)
    with logged(store) if batch.tasks or Store.is_at(store) else nullcontext():
        measured = show_measuring(batch, tally)
        kept = batch.store if measured else None
        if kept is not None:
            for superseded in relate(kept):
                say(str(superseded))
        if kept is not None and not measure_only:
            ids = [known for one in measured for known in one.measurement_ids]
            judged = show_judging(judge_all(kept, ids, replace(settings, only_stale=True)), kept, tally)
        elif kept is not None:
            judged = [Judged(one.recording.name, known) for one in measured for known in one.measurement_ids]
            say("measured only: no verdicts were reached; auditor judge reaches them")
            tally.incomplete = True
            tally.not_audited += [
                NotAudited(storable(one.recording.name), storable(str(one.recording)), "measured only")
                for one in measured
            ]
        if Store.is_at(store):
            keep_ledger(kept or Store.open(store), tally.errors, measured, judged)
        if kept is not None and (packed := pack_where_many(kept)).files:
            say(f"{store}: {packed.files} small files are {packed.packs} now, as by auditor store compact")
        found = [one.measurement_id for one in judged if one.found and (batch.shows_known or one.fresh)]
        if kept is not None and found:
            for pictured in picture_incidents(kept, found, measuring.pictures, measuring.limits, measuring.jobs):
                if pictured.remark:
                    say(f"{pictured.recording}: {pictured.remark}")
        shown, show_known = {one.recording_id for one in measured}, batch.shows_known or form != "table"
        show_audit(kept, form, tally, shown, judged, show_known=show_known)
    return tally.exit_code()

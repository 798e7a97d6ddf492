"""`auditor calibrate`: thresholds from clean recordings."""

import shlex
from collections.abc import Collection
from contextlib import nullcontext
from decimal import Decimal
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit, Tally
from auditor.cli.logged import logged
from auditor.cli.output import format_option, say
from auditor.cli.values import PATH
from auditor.errors import SettingError

if TYPE_CHECKING:
    from auditor.model.settings import MeasureSettings
    from auditor.pipeline.calibrations.making import MadeCalibration
    from auditor.pipeline.calibrations.versions import Kept
    from auditor.pipeline.measured import Measured
    from auditor.store import Store


class _Frames(click.ParamType[range]):
    name = "from:to"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> range:
        if isinstance(value, range):
            return value
        first, colon, last = str(value).partition(":")
        try:
            chosen = range(int(first or 0), int(last) if last else 1 << 62)
        except ValueError:
            chosen = range(0)
        if not colon or not chosen:
            self.fail(f"{value!r} is not a range of frames: write 0:20 for the first twenty", param, ctx)
        return chosen


@click.command("calibrate", short_help="Thresholds from clean recordings.")
@click.argument("sources", nargs=-1, required=True, metavar="RECORDING|STORE...", type=PATH)
@options.store_option
@options.setting("r", "The r whose thresholds are shown.")
@options.setting("method")
@options.setting("strict")
@click.option("--frames", type=_Frames(), help="Only these frame numbers of each recording, such as 0:200.")
@click.option("--out", type=PATH, help="Also write the thresholds artefact to this file.")
@options.setting("recount")
@options.measuring_options(*options.MEASURING)
@format_option
def command(
    sources: tuple[Path, ...],
    store: Path,
    r: Decimal,
    method: str,
    frames: range | None,
    out: Path | None,
    measuring: "MeasureSettings",
    form: str,
    *,
    strict: bool,
    recount: bool,
) -> int:
    """Make thresholds from recordings that are known to be clean, or from the clean measurements of stores.

    A store's measurements with incidents are left out, and so is every recording that carries the ground truth of an
    attack. Recordings that are named themselves are taken as clean.

    \b
    auditor calibrate clean_logs/*.mcap
    auditor calibrate drive.mcap --frames 0:200 -r 0

    The artefact keeps the statistics of every clean frame, so that thresholds at any r and by both methods follow from
    it. It holds for one rig kind, matcher and setting, and is refused for others. By the robust method each recording
    is a drive, and thresholds are learnt from how much drives differ: several short ones teach more than one long one.
    Each recording is also judged by the others: the frames that are then not clean show how many of other roads will
    be.

    Recordings of several rig kinds give one calibration each, shown one after the other.

    The first calibration of a rig kind is in force: scans judge by it. Later ones are candidates, until auditor
    calibration promote puts one in force.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.calibration_tables import show_left_out, show_paper, show_robust  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output_files import check_thresholds  # noqa: PLC0415
    from auditor.cli.summary import show_measuring  # noqa: PLC0415
    from auditor.pipeline.calibrations.making import by_kind, make  # noqa: PLC0415
    from auditor.pipeline.calibrations.versions import keep_calibrated  # noqa: PLC0415
    from auditor.pipeline.many import choose_clean, find_batch  # noqa: PLC0415
    from auditor.pipeline.scan import Scan  # noqa: PLC0415
    from auditor.store import Store, write_calibration  # noqa: PLC0415

    if out:
        check_thresholds(out)
    tally = Tally()
    stores = [path for path in sources if Store.is_at(path)]
    recordings = [path for path in sources if path not in stores]
    opened = [Store.open(path) for path in stores]
    batch = find_batch(recordings, store, measuring) if recordings else None
    with logged(store) if (batch and batch.tasks) or Store.is_at(store) else nullcontext():
        measured: list[Measured] = []
        given: list[tuple[Store, str]] = []
        if batch is not None:
            scan = Scan(batch, store)
            show_measuring(scan, tally)
            measured, given = scan.measured, [(Store.open(store), known) for known in scan.measurement_ids]
        if Store.is_at(store):
            _tell_relations(Store.open(store), {one.recording_id for one in measured}, tally)
        clean = choose_clean(given, opened)
        for reason in clean.left_out:
            say(reason)
        groups = by_kind(clean)
        if out and len(groups) > 1:
            raise SettingError(
                f"these recordings have {len(groups)} rig kinds or procedures, and a file holds one calibration",
                where="--out",
                remedy="leave it out, and write each with auditor calibration export",
            )
        every = [make(one, r, frames, recount=recount, jobs=measuring.jobs) for one in groups]
        for made in every:
            _check_rate(made, method, strict=strict)
        kept = Store.open(store, create=True)
        known = [keep_calibrated(kept, made) for made in every]
        if out:
            write_calibration(every[0].calibration, out)
    for made, of_kind in zip(every, known, strict=True):
        if method == "robust":
            show_robust(made, form)
        else:
            show_paper(made.calibration, kept, r, form)
        show_left_out(of_kind, r, form)
        _say_in_force(of_kind, store)
    return Exit.INCOMPLETE if tally.failed or tally.incomplete else Exit.CLEAN


def _say_in_force(made: "Kept", store: Path) -> None:
    """What scans judge by from now on: a later calibration is a candidate until a person promotes it."""
    known = made.version.calibration_id[:12]
    if made.in_force:
        say(f"calibration {known} is in force for its rig kind: scans judge by it")
        return
    say(
        f"calibration {known} is a candidate: {(made.version.parent or '')[:12]} stays in force for its rig kind; "
        f"auditor calibration promote {known} --store {shlex.quote(str(store))} puts it in force"
    )


def _tell_relations(store: "Store", recording_ids: Collection[str], tally: Tally) -> None:
    """Say which recordings count no longer, and which of those given are in conflict with others."""
    from auditor.pipeline.remarks import conflicts_of  # noqa: PLC0415 - keeps --help quick
    from auditor.store.maintenance.relations import relate  # noqa: PLC0415

    for superseded in relate(store):
        say(str(superseded))
    for recording in map(store.recording, sorted(recording_ids)):
        for conflict in conflicts_of(store, recording):
            say(f"{recording.name}: {conflict}")
            tally.incomplete = True


def _check_rate(made: "MadeCalibration", method: str, *, strict: bool) -> None:
    from auditor.identification.thresholds import resolvable  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.judge import refuse_unproven  # noqa: PLC0415

    if method == "robust":
        if strict:
            refuse_unproven(made.thresholds)
        return
    fewest, r = min(made.samples.values()), made.asked.r
    if resolvable(r, fewest):
        return
    what = f"r = {r} is not resolvable with {fewest} clean samples"
    if strict:
        raise SettingError(what, where="-r", remedy=f"take r = 0, or calibrate on {ceil(1 / r)} frames or more")
    say(f"{what}: its thresholds are those of r = 0")

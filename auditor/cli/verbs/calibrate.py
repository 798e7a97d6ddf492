"""`auditor calibrate`: thresholds from clean recordings."""

import shlex
from collections.abc import Collection, Iterable, Sequence
from contextlib import nullcontext, suppress
from decimal import Decimal
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit, Tally
from auditor.cli.logged import logged
from auditor.cli.options import PATH, PLACE
from auditor.cli.output import format_option, say
from auditor.errors import AuditorError, SettingError, ThresholdsError
from auditor.model.text import first_few

if TYPE_CHECKING:
    from auditor.model.rig_kind import RigKind
    from auditor.model.settings import MeasureSettings
    from auditor.pipeline.calibrations.clean import CleanMeasurements
    from auditor.pipeline.calibrations.making import MadeCalibration
    from auditor.pipeline.calibrations.versions import CalibrationEntry
    from auditor.pipeline.remote.addresses import Address
    from auditor.pipeline.scan import Scan
    from auditor.store.store import Store


_MOST_NAMED = 3


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
@click.argument("sources", nargs=-1, required=True, metavar="RECORDING|STORE...", type=PLACE)
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
    sources: "tuple[Path | Address, ...]",
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
    from auditor.cli.output_files import check_thresholds  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.calibrations.clean import choose_clean  # noqa: PLC0415
    from auditor.pipeline.calibrations.versions import keep_calibrated  # noqa: PLC0415
    from auditor.pipeline.many import find_batch  # noqa: PLC0415
    from auditor.pipeline.scan import Scan  # noqa: PLC0415
    from auditor.store.calibrations import write_calibration  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    if out:
        check_thresholds(out)
    tally = Tally()
    stores = [one for one in sources if isinstance(one, Path) and Store.is_at(one)]
    recordings = [one for one in sources if one not in stores]
    opened = [Store.open(path) for path in stores]
    scan = Scan(find_batch(recordings, store, measuring), store) if recordings else None
    if out and scan is not None:
        _refuse_kinds(_kinds_of(scan), "rig kinds")
    with logged(store) if (scan and scan.batch.tasks) or Store.is_at(store) else nullcontext():
        given = _measured(scan, store, tally)
        clean = choose_clean(given, opened)
        for reason in clean.left_out:
            say(reason)
        if not clean.chosen and not given and not opened:
            _refuse_unmeasured(tally)
        every = _made(clean, r, frames, recount=recount, jobs=measuring.jobs, one_file=out is not None)
        for made in every:
            _check_rate(made, method, strict=strict)
        kept = Store.open(store, create=True)
        versions = [keep_calibrated(kept, made) for made in every]
        if out:
            write_calibration(every[0].calibration, out)
    for made, version in zip(every, versions, strict=True):
        _show(made, version, kept, method, r, form)
    return Exit.INCOMPLETE if tally.failed or tally.incomplete else Exit.CLEAN


def _measured(scan: "Scan | None", store: Path, tally: Tally) -> "list[tuple[Store, str]]":
    """The measurements of a scan, once all is measured and related to what the store has."""
    from auditor.cli.summary import show_measuring  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415

    if scan is not None:
        show_measuring(scan, tally)
    if Store.is_at(store):
        _tell_relations(Store.open(store), {one.recording_id for one in scan.measured} if scan else set(), tally)
    return [(Store.open(store), measurement) for measurement in scan.measurement_ids] if scan else []


def _made(
    clean: "CleanMeasurements", r: Decimal, frames: range | None, *, recount: bool, jobs: int, one_file: bool
) -> "list[MadeCalibration]":
    """A calibration of each rig kind and procedure. Raises SettingError for several that are to be `one_file`."""
    from auditor.pipeline.calibrations.making import by_kind, make_each, without_pasts  # noqa: PLC0415

    groups = without_pasts(by_kind(clean)) if one_file else by_kind(clean)
    if one_file:
        firsts = (group.chosen[0] for group in groups if group.chosen)
        kinds = [store.rig(store.measurement(measurement).rig_id).kind for store, measurement in firsts]
        _refuse_kinds(kinds, "rig kinds or procedures")
    return list(make_each(groups, r, frames, recount=recount, jobs=jobs))


def _refuse_unmeasured(tally: Tally) -> None:
    """Raises ThresholdsError with the reasons where recordings were given and none could be measured."""
    reasons = dict.fromkeys(one.reason.split(";", maxsplit=1)[0] for one in tally.not_audited)
    if reasons:
        raise ThresholdsError(
            f"no recording could be measured to calibrate on: {first_few([*reasons], _MOST_NAMED)}",
            remedy="the lines above say of each what it lacks",
        )


def _kinds_of(scan: "Scan") -> "list[RigKind]":
    """The rig kinds of recordings, before any is measured; what cannot be read is said by measuring it.

    Of files that the store knows they are in the store; only others are read, as far as their beginning.
    """
    from auditor.cli.recording_description import kinds_of_rigs  # noqa: PLC0415 - keeps --help quick
    from auditor.model.rig_kind import ComparedTo  # noqa: PLC0415
    from auditor.pipeline.calibrations.clean import attacked_by_labels  # noqa: PLC0415
    from auditor.pipeline.many import known_files  # noqa: PLC0415
    from auditor.pipeline.workers import run_within  # noqa: PLC0415

    batch, kinds = scan.batch, list["RigKind"]()
    files = known_files(batch) if batch.tasks else None
    for task in batch.tasks:
        of_rigs: Iterable[RigKind] = ()
        if batch.store and files and (measured := files.measured(task)):
            clean = (one for one in measured.measurement_ids if not attacked_by_labels(batch.store, one))
            of_rigs = [batch.store.rig(batch.store.measurement(one).rig_id).kind for one in clean]
        elif task.location.remote is None:
            with suppress(AuditorError):
                of_rigs = run_within(batch.limits(task.location), kinds_of_rigs, task.location, task.rig)
        kinds += (one for one in of_rigs if not any(one.matches(known) for known in kinds))
    cameras = any(one.compared_to is ComparedTo.CAMERAS for one in kinds)
    return [one for one in kinds if not (cameras and one.compared_to is ComparedTo.PAST)]


def _refuse_kinds(kinds: "Sequence[RigKind]", told_as: str) -> None:
    """Raises SettingError for several kinds, whose calibrations are to be in one file."""
    if len(kinds) > 1:
        raise SettingError(
            f"these recordings have {len(kinds)} {told_as} ({'; '.join(map(str, kinds))}), and a file holds one "
            "calibration",
            where="--out",
            remedy="leave it out, and write each with auditor calibration export",
        )


def _show(
    made: "MadeCalibration", version: "CalibrationEntry", store: "Store", method: str, r: Decimal, form: str
) -> None:
    """Print the thresholds of a calibration, how it judges what it has not seen, and whether it is in force."""
    from auditor.cli.calibration_tables import show_left_out, show_paper, show_robust  # noqa: PLC0415 - keeps --help quick

    if method == "robust":
        show_robust(made, form)
    else:
        show_paper(made.calibration, store, r, form)
    show_left_out(version, r, form)
    _say_in_force(version, store.folder)


def _say_in_force(made: "CalibrationEntry", store: Path) -> None:
    """What scans judge by from now on: a later calibration is a candidate until a person promotes it."""
    short_id = made.version.calibration_id[:12]
    if made.in_force:
        say(f"calibration {short_id} is in force for its rig kind: scans judge by it")
        return
    say(
        f"calibration {short_id} is a candidate: {(made.version.parent or '')[:12]} stays in force for its rig kind; "
        f"auditor calibration promote {short_id} --store {shlex.quote(str(store))} puts it in force"
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
    problem = f"r = {r} is not resolvable with {fewest} clean samples"
    if strict:
        raise SettingError(problem, where="-r", remedy=f"take r = 0, or calibrate on {ceil(1 / r)} frames or more")
    say(f"{problem}: its thresholds are those of r = 0")

"""`auditor calibrate`: thresholds from clean recordings."""

from collections.abc import Iterator
from decimal import Decimal
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import Exit, options
from auditor.cli.output import format_option, say
from auditor.errors import SettingError

if TYPE_CHECKING:
    from auditor.cli.measuring import Measuring
    from auditor.store import Store, StoredJudgement


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
            self.fail(f"{value!r} is no range of frames: write 0:20 for the first twenty", param, ctx)
        return chosen


@click.command("calibrate", short_help="Thresholds from clean recordings.")
@click.argument("sources", nargs=-1, required=True, metavar="RECORDING|STORE...", type=click.Path(path_type=Path))
@options.store_option
@click.option("-r", "r", type=options.RATE, default="0.01", show_default=True, help="The r whose thresholds are shown.")
@options.method_option
@click.option("--strict", is_flag=True, help="Refuse an r that the clean samples cannot resolve (r < 1/N).")
@click.option("--frames", type=_Frames(), help="Only these frame numbers of each recording, such as 0:200.")
@click.option("--out", type=click.Path(path_type=Path), help="Also write the thresholds artefact to this file.")
@options.recount_option
@options.measuring_options
@format_option
def command(
    sources: tuple[Path, ...],
    store: Path,
    r: Decimal,
    method: str,
    frames: range | None,
    out: Path | None,
    measuring: "Measuring",
    form: str,
    *,
    strict: bool,
    recount: bool,
) -> int:
    """Learn thresholds from recordings that are known to be clean, or from the clean measurements of stores.

    Of a store's measurements those with incidents are left out, and so is whatever carries the ground truth of an
    attack; recordings that are given themselves are taken at their word.

    \b
    auditor calibrate clean_logs/*.mcap
    auditor calibrate drive.mcap --frames 0:200 -r 0

    The artefact keeps what was measured of every clean frame, so that thresholds at any r and by both methods follow
    from it. It holds for one rig kind, matcher and setting, and is refused for others. Each recording is also judged by
    the others: how often they raise it is what the thresholds will do on roads that they have not seen.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.calibration_tables import show_left_out, show_paper, show_robust  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.judging import Tally  # noqa: PLC0415
    from auditor.cli.measuring import measure_all  # noqa: PLC0415
    from auditor.cli.output_files import check_thresholds  # noqa: PLC0415
    from auditor.errors import ThresholdsError  # noqa: PLC0415
    from auditor.pipeline.judge import calibrate, system_of  # noqa: PLC0415
    from auditor.store import Store, write_calibration  # noqa: PLC0415

    if out:
        check_thresholds(out)
    tally = Tally()
    stores = [path for path in sources if Store.is_at(path)]
    recordings = [path for path in sources if path not in stores]
    opened = [Store.open(path) for path in stores]
    given: list[tuple[Store, str]] = []
    if recordings:
        measured = measure_all(recordings, store, tally, measuring)
        given = [(Store.open(store), known) for one in measured for known in one.measurement_ids]
    clean = [one for kept in opened for one in _cleared(kept, {known for _, known in given})]
    clean += [(kept, known) for kept, known in given if _is_clean(kept, known)]
    if not clean:
        raise ThresholdsError(
            "no clean recording to calibrate on", remedy="give recordings that are known to be free of attacks"
        )
    calibration = calibrate(clean, frames, recount=recount)
    fewest = min(len(samples) for samples in calibration.samples.values())
    _check_resolution(r, fewest, strict=strict)
    kept = Store.open(store, create=True)
    kept.write_calibration(calibration)
    if out:
        write_calibration(calibration, out)
    one, known = clean[0]
    system = system_of(one.rig(one.measurement(known).rig_id))
    if method == "robust":
        show_robust(calibration, system, r, form)
    else:
        show_paper(calibration, kept, r, form)
    show_left_out(calibration, system, r, form, dict(_name(store, known) for store, known in clean))
    return Exit.INCOMPLETE if tally.failed or tally.incomplete else Exit.CLEAN


def _name(store: "Store", measurement: str) -> tuple[str, str]:
    """The id of a measurement's recording, and what the user calls it."""
    recording_id = store.measurement(measurement).recording_id
    return recording_id, store.recording(recording_id).name


def _is_clean(store: "Store", measurement: str) -> bool:
    """False, and said so, where the recording carries the ground truth of an attack."""
    from auditor.cli.judging import recording_name  # noqa: PLC0415

    attacked = bool(store.labels(store.measurement(measurement).recording_id))
    if attacked:
        say(f"{recording_name(store, measurement)}: left out: it carries the ground truth of an attack")
    return not attacked


def _cleared(store: "Store", given: set[str]) -> "Iterator[tuple[Store, str]]":
    """What a store holds beside the measurements `given` that neither labels nor verdicts speak against."""
    judgements = store.current_judgements()
    for known in store.ids("measurements"):
        if known not in given and _is_clean(store, known) and _is_cleared(store, known, judgements.get(known)):
            yield store, known


def _is_cleared(store: "Store", measurement: str, judgement: "StoredJudgement | None") -> bool:
    """False, and said so, where the store's own verdicts speak against a measurement that nobody called clean."""
    from auditor.cli.judging import recording_name  # noqa: PLC0415

    if judgement is None or not judgement.in_incidents:
        return True
    count = judgement.in_incidents
    say(
        f"{recording_name(store, measurement)}: left out: by its current verdicts (method {judgement.method}, "
        f"r = {judgement.r}) {count} frame{' is' if count == 1 else 's are'} in incidents; if it is known to be clean, "
        "give the recording itself, or judge the store again (auditor judge) where the verdicts were wrong"
    )
    return False


def _check_resolution(r: Decimal, fewest: int, *, strict: bool) -> None:
    from auditor.identification.thresholds import resolvable  # noqa: PLC0415

    if resolvable(r, fewest):
        return
    what = f"r = {r} is not resolvable with {fewest} clean samples"
    if strict:
        raise SettingError(what, where="-r", remedy=f"take r = 0, or calibrate on {ceil(1 / r)} frames or more")
    say(f"{what}: its thresholds are those of r = 0")

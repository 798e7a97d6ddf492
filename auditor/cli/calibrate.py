"""`auditor calibrate`: thresholds from clean recordings."""

from decimal import Decimal
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import Exit, options
from auditor.cli.output import emit, format_option, print_rows, say
from auditor.errors import SettingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from auditor.engines import Limits
    from auditor.evidence.matchers import MatcherOptions
    from auditor.recordings import Origin
    from auditor.store import Store
    from auditor.thresholds import Calibration


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
@click.option("--strict", is_flag=True, help="Refuse an r that the clean samples cannot resolve (r < 1/N).")
@click.option("--frames", type=_Frames(), help="Only these frame numbers of each recording, such as 0:200.")
@click.option("--out", type=click.Path(path_type=Path), help="Also write the thresholds artefact to this file.")
@options.matcher_options
@options.rig_option
@options.origin_options
@options.budget_options
@options.jobs_option
@format_option
def command(
    sources: tuple[Path, ...],
    store: Path,
    r: Decimal,
    frames: range | None,
    out: Path | None,
    matcher: str,
    network: "MatcherOptions",
    rig: Path | None,
    origin_of: "Callable[[Path], Origin]",
    budget: "Callable[[Path], Limits]",
    jobs: int,
    form: str,
    *,
    strict: bool,
) -> int:
    """Learn thresholds from recordings that are known to be clean, or from the clean measurements of stores.

    \b
    auditor calibrate clean_logs/*.mcap
    auditor calibrate drive.mcap --frames 0:200 -r 0

    The artefact keeps every clean disparity error, so that thresholds at any r follow from it. It holds for one rig
    kind, matcher and setting, and is refused for others.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.judging import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.measuring import measure_all  # noqa: PLC0415
    from auditor.errors import ThresholdsError  # noqa: PLC0415
    from auditor.pipeline import calibrate  # noqa: PLC0415
    from auditor.store import Store, run_query, write_calibration  # noqa: PLC0415

    tally = Tally()
    stores = [path for path in sources if Store.is_at(path)]
    recordings = [path for path in sources if path not in stores]
    measurements = [(kept, known) for kept in map(Store.open, stores) for known in kept.ids("measurements")]
    if recordings:
        measured = measure_all(
            recordings,
            store,
            tally,
            matcher=matcher,
            network=network,
            rig=rig,
            origin_of=origin_of,
            budget=budget,
            jobs=jobs,
        )
        measurements += [(Store.open(store), known) for one in measured for known in one.measurement_ids]
    clean = [(kept, known) for kept, known in measurements if _is_clean(kept, known)]
    if not clean:
        raise ThresholdsError(
            "no clean recording to calibrate on", remedy="give recordings that are known to be free of attacks"
        )
    calibration = calibrate(clean, frames)
    fewest = min(len(samples) for samples in calibration.samples.values())
    _check_resolution(r, fewest, strict=strict)
    kept = Store.open(store, create=True)
    kept.write_calibration(calibration)
    if out:
        write_calibration(calibration, out)
    thresholds = run_query(kept, "thresholds", {"calibration": calibration.calibration_id, "r": r})
    if form == "table":
        _show(calibration, thresholds.to_pylist())
    else:
        emit(thresholds, form)
    return Exit.INCOMPLETE if tally.failed or tally.incomplete else Exit.CLEAN


def _show(calibration: "Calibration", thresholds: list[dict[str, Any]]) -> None:
    """The thresholds with the columns that a person wants."""
    rows = [{**row, "triple": f"{row['i']},{row['j']},{row['k']}", "max": row["largest"]} for row in thresholds]
    click.echo(f"Calibration {calibration.calibration_id} from {len(calibration.recordings)} clean recordings")
    click.echo(f"holds for {calibration.rig_kind}, matcher {calibration.procedure.matcher}")
    print_rows(rows, ("statistic", "triple", "N", "median", "max", "r", "theta", "resolvable"))


def _is_clean(store: "Store", measurement: str) -> bool:
    """False, and said so, where the recording carries the ground truth of an attack."""
    from auditor.cli.judging import recording_name  # noqa: PLC0415

    attacked = bool(store.labels(store.measurement(measurement).recording_id))
    if attacked:
        say(f"{recording_name(store, measurement)}: left out: it carries the ground truth of an attack")
    return not attacked


def _check_resolution(r: Decimal, fewest: int, *, strict: bool) -> None:
    from auditor.identification.thresholds import resolvable  # noqa: PLC0415

    if resolvable(r, fewest):
        return
    what = f"r = {r} is not resolvable with {fewest} clean samples"
    if strict:
        raise SettingError(what, where="-r", remedy=f"take r = 0, or calibrate on {ceil(1 / r)} frames or more")
    say(f"{what}: its thresholds are those of r = 0")

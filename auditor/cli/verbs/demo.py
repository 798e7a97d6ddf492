"""`auditor demo`: the first thing a newcomer runs."""

import re
import shlex
import shutil
from collections import deque
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit, Tally
from auditor.cli.logged import logged
from auditor.cli.options import PATH
from auditor.cli.output import answer, print_rows, progress, say
from auditor.model.verdict import Method

if TYPE_CHECKING:
    from auditor.lab.demo import Take
    from auditor.model.settings import MeasureSettings
    from auditor.pipeline.scan import Scan
    from auditor.pipeline.workers import Limits
    from auditor.store.store import Store

_MARKER = ".auditor-demo"
_MADE = re.compile(
    r"""\.auditor-demo
    | (.+/)?\.[^/]+\.part(/.+)?  # what a killed demo was writing
    | audit/(
        store\.json | log/[\w.-]+\.jsonl | \w+/[0-9a-f]{8,64}\.parquet
        | pictures/[0-9a-f]{8,64}/\d+_S\d+(\.\w+)?\.(jpg|png)
        | reports/(incident|evaluation|index|incidents/[0-9a-f]{32})\.html
    )
    """,
    re.VERBOSE,
)
"""What a demo makes beside its recordings: the store and its pages."""
_MOST_NAMED = 3


@click.command("demo", short_help="A whole audit on a small fleet made here.")
@click.argument("folder", type=PATH, default=Path("auditor-demo"))
@options.setting("method")
@options.setting("jobs")
def command(folder: Path, method: str, jobs: int) -> int:
    """Make a small fleet, attack three of its drives, audit them all, and write their pages.

    \b
    auditor demo
    auditor demo /tmp/demo

    Everything lands in the folder: the recordings, the store, the pages. Exits with 0 when the audit names exactly the
    sensors that were attacked.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.lab.demo import fleet  # noqa: PLC0415 - keeps --help quick
    from auditor.reporting.fleet import render_fleet_report  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    clean, suspected = fleet(folder)
    _prepare(folder, (*clean, *suspected))
    _record((*clean, *suspected), jobs)
    kept = Store.open(folder / "audit", create=True)
    with logged(kept.folder):
        complete = _audit(kept, clean, suspected, Method(method), jobs)
        exact = _compare(kept, suspected)
        page = render_fleet_report(kept, out=kept.folder / "reports")
    answer(f"The pages:         {page}")
    answer(f"Query the store:   auditor query --store {shlex.quote(str(kept.folder))}")
    return Exit.CLEAN if exact and complete else Exit.FINDINGS


def _audit(kept: "Store", clean: "Sequence[Take]", suspected: "Sequence[Take]", method: "Method", jobs: int) -> bool:
    """Learn from the clean drives, judge all by that, and print what was found; True where nothing failed."""
    from auditor.cli.summary import show_audit, show_judging, show_measuring  # noqa: PLC0415 - keeps --help quick
    from auditor.model.settings import Criteria, MeasureSettings  # noqa: PLC0415
    from auditor.pipeline.calibrations.clean import CleanMeasurements  # noqa: PLC0415
    from auditor.pipeline.calibrations.making import make  # noqa: PLC0415
    from auditor.pipeline.calibrations.versions import keep_calibrated  # noqa: PLC0415
    from auditor.pipeline.judged import JudgeSettings, judge_all  # noqa: PLC0415

    of_clean, tally = Tally(), Tally()
    learnt, scan = (_scan_of(takes, kept, MeasureSettings(jobs=jobs)) for takes in (clean, suspected))
    show_measuring(learnt, of_clean)
    given = tuple((kept, known) for known in learnt.measurement_ids)
    made = make(CleanMeasurements(given, ()), Criteria.r, jobs=jobs)
    keep_calibrated(kept, made, made_by="demo")
    show_measuring(scan, tally)
    r = Criteria.r if method is Method.ROBUST else Decimal(0)
    judging = JudgeSettings(Criteria(r, method, strict=True, min_coverage=1), made.calibration)
    deque(judge_all(kept, learnt.measurement_ids, judging), maxlen=0)  # else the pages would call them not judged
    judged = show_judging(judge_all(kept, scan.measurement_ids, judging), kept, tally)
    _picture(kept, [one.measurement_id for one in judged if one.found], jobs)
    show_audit(kept, "table", tally, judged)
    return not (of_clean.failed or tally.failed)


def _scan_of(takes: "Sequence[Take]", kept: "Store", measuring: "MeasureSettings") -> "Scan":
    from auditor.pipeline.many import find_batch  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.scan import Scan  # noqa: PLC0415

    files = [take.file for take in takes]
    return Scan(find_batch(files, kept.folder, measuring, _unlimited), kept.folder)


def _unlimited(_: object) -> "Limits":
    from auditor.pipeline.workers import Limits  # noqa: PLC0415 - keeps --help quick

    return Limits()


def _picture(kept: "Store", recordings: Sequence[str], jobs: int) -> None:
    """Keep pictures of what was found in these measurements."""
    from auditor.model.pictures import Pictures  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.pictures import picture_incidents  # noqa: PLC0415

    for pictured in picture_incidents(kept, recordings, Pictures.INCIDENTS, _unlimited, jobs):
        if pictured.remark:
            say(f"{pictured.recording}: {pictured.remark}")


def _prepare(folder: Path, takes: "Sequence[Take]") -> None:
    """An empty folder; what an earlier demo left there is removed, if nothing else is among it."""
    from auditor.errors import SettingError  # noqa: PLC0415

    remedy = "name an empty or a new folder"
    if folder.exists() and not folder.is_dir():
        raise SettingError("it is a file", where=folder, remedy=remedy)
    there = list(folder.iterdir()) if folder.exists() else []
    if there and not (folder / _MARKER).exists():
        raise SettingError("the folder is not empty", where=folder, remedy=remedy)
    if strange := _strange(folder, [take.file.name for take in takes]):
        named = ", ".join(strange[:_MOST_NAMED]) + (", ..." if len(strange) > _MOST_NAMED else "")
        raise SettingError(
            f"beside an earlier demo the folder holds {named}", where=folder, remedy=f"move that elsewhere, or {remedy}"
        )
    for path in there:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _MARKER).touch()


def _strange(folder: Path, names: Sequence[str]) -> list[str]:
    """What no demo makes, by its place in the folder; recordings may be files or rosbag2 folders."""
    recordings = {place for name in names for place in (name, f"{name}/metadata.yaml", f"{name}/{name}.db3")}
    files = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    places = (path.relative_to(folder).as_posix() for path in files)
    return sorted(place for place in places if place not in recordings and not _MADE.fullmatch(place))


def _record(takes: "tuple[Take, ...]", jobs: int) -> None:
    from auditor.lab.demo import record  # noqa: PLC0415
    from auditor.pipeline.workers import run_all  # noqa: PLC0415

    say(f"making {len(takes)} drives of three vehicles (LiDAR and three cameras), three of them attacked")
    with progress(len(takes), "rendering") as (advanced, finished):
        for outcome in run_all(record, takes, jobs, advanced):
            if outcome.error:
                raise outcome.error
            finished()


def _compare(store: "Store", takes: "tuple[Take, ...]") -> bool:
    """Print what was planted beside what was found; True where they are the same."""
    from auditor.store.export import rows_of  # noqa: PLC0415
    from auditor.store.queries import run_query  # noqa: PLC0415

    summary = {row["name"]: row for row in rows_of(run_query(store, "summary", {}))}
    incidents = rows_of(run_query(store, "incidents", {}))
    rows = []
    for take in takes:
        verdict = summary[take.file.name]
        planted = [] if take.attacked is None else [take.attacked]
        rows.append(
            {
                "recording": take.file.name,
                "vehicle": take.vehicle.name,
                "planted": [f"S_{sensor}" for sensor in planted],
                "found": [f"S_{sensor}" for sensor in verdict["attacked_sensors"]],
                "frames attacked": len(take.attacked_frames),
                "frames named": sum(
                    row["frames"] for row in incidents if row["attacked"] and row["name"] == take.file.name
                ),
                "exact": verdict["attacked_sensors"] == planted,
            }
        )
    click.echo()
    print_rows(rows, tuple(rows[0]), title="Planted and found")
    return all(row["exact"] for row in rows)

"""`auditor calibration`: versions of calibrations, and which is in force."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged
from auditor.cli.options import PATH
from auditor.cli.output import (
    answer,
    check_in_words,
    emit,
    emit_columns,
    format_option,
    print_rows,
    say,
    shown,
    write_bytes,
)

if TYPE_CHECKING:
    from decimal import Decimal

    from auditor.store.store import Store

_BRIEF = 12
_LIST_COLUMNS = ("calibration_id", "state", "kind", "recordings", "frames", "by_others", "made_at", "made_by", "parent")
_USED_COLUMNS = ("recording", "vehicle", "day", "in", "frames", "findings", "look at", "reason")
_CONDITION_COLUMNS = ("condition", "value", "drives", "windows", "raised", "share", "low", "high")
_WAITING_COLUMNS = ("recording_id", "name", "vehicle", "day", "since", "findings", "frames", "reason", "kind")
_MADE = (
    "hours",
    "frames_by_others",
    "findings_by_others",
    "incidents_by_others",
    "auditor_version",
    "counting_version",
    "judging_version",
    "rules",
)
"""What is said of how one was made besides the columns of the list: sample counts, the tool, and its rules."""
_DIFF_COLUMNS = ("check", "sensor", "others", "theta A", "theta B", "rise")

_id_argument = click.argument("calibration", metavar="ID")
_reason_option = click.option("--reason", default="", help="Why, in your own words: it is kept in the history.")


@click.group("calibration", short_help="Versions of calibrations: list, compare, promote, roll back.")
def command() -> None:
    """Versions of calibrations, and which is in force for each rig kind. An ID may be the beginning of one.

    \b
    auditor calibration list
    auditor calibration show 4be19a40
    auditor calibration diff 4be19a40 77c0ffee
    auditor calibration promote 77c0ffee
    auditor calibration rollback
    auditor calibration quarantine
    auditor calibration verify
    auditor calibration export 4be19a40 fleet.thresholds

    Scans judge by the version in force, and judgements keep theirs. A candidate can be tried: auditor judge
    --calibration ID.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines


@command.command("list", short_help="The calibrations of a store, and which are in force.")
@options.store_option
@format_option
def list_versions(store: Path, form: str) -> None:
    """List the calibrations of a store: those in force first, then what became of the others.

    \b
    auditor calibration list
    auditor calibration list --store night/audit --format json
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.export import rows_of  # noqa: PLC0415 - keeps --help quick
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    versions = run_query(Store.open(store), "versions", {})
    if form != "table":
        emit(versions, form)
        return
    rows = [
        {**row, "state": f"{row['state']}{', provisional' * bool(row['provisional'])}", "parent": _brief(row["parent"])}
        for row in rows_of(versions)
    ]
    print_rows(rows, _LIST_COLUMNS, expendable=("made_by", "parent", "made_at"), wrapped=("kind",))


@command.command("show", short_help="How a calibration was made, and of what.")
@_id_argument
@options.store_option
@click.option("--format", "form", type=click.Choice(["table", "json"]), default="table", help="How it is printed.")
def show(calibration: str, store: Path, form: str) -> None:
    """Show how a calibration was made, what it was tried on, and which recordings are in it or were left out, and why.

    \b
    auditor calibration show 4be19a40
    auditor calibration show 4be19a40 --format json
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.export import as_json, rows_of  # noqa: PLC0415 - keeps --help quick
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick
    from auditor.store.versions.history import histories  # noqa: PLC0415
    from auditor.store.versions.records import read_version  # noqa: PLC0415

    kept = Store.open(store)
    calibration_id = _named(kept, calibration)
    [row] = rows_of(run_query(kept, "versions", {"calibration": calibration_id}))
    version = read_version(kept, calibration_id)
    made = {name: getattr(version, name) for name in _MADE} if version else {}
    used = [vars(one) for one in version.recordings] if version else []
    conditions = [vars(one) for one in version.conditions] if version else []
    moves = [vars(move) for one in histories(kept) for move in one.moves if move.calibration_id == calibration_id]
    if form == "json":
        write_bytes(as_json({**row, **made, "moves": moves, "used": used, "conditions": conditions}))
        return
    for name, value in {**row, **made}.items():
        answer(f"{name:>19}  {shown(value)}")
    for move in moves:
        moved = f"{move['moved_at']:%Y-%m-%dT%H:%M:%SZ}, {move['how']}"
        answer(f"{'in force from':>19}  {moved}{': ' * bool(move['reason'])}{shown(move['reason'])}")
    if conditions:
        print_rows([_condition(one) for one in conditions], _CONDITION_COLUMNS, "Windows raised, each judged by others")
    if used:
        print_rows([_used(one) for one in used], _USED_COLUMNS, "Recordings", wrapped=("reason",))
    else:
        say("how it was made is not known: it came from a file, or from an earlier auditor")


@command.command("diff", short_help="What differs between two calibrations.")
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@options.store_option
@options.setting("r", "The r of the thresholds.")
@format_option
def diff(first: str, second: str, store: Path, r: "Decimal", form: str) -> None:
    """Compare two calibrations: recordings, and the thresholds of the checks that count, the largest rise first.

    \b
    auditor calibration diff 4be19a40 77c0ffee
    auditor calibration diff 4be19a40 77c0ffee -r 0.1% --format csv

    A rise is how many standard deviations of A the threshold of B lies higher: attacks of that size more are missed.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.identification.prior import statistic_at  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.calibrations.versions import steps_between  # noqa: PLC0415
    from auditor.store.export import table_of  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    kept = Store.open(store)
    a, b = (kept.calibration(_named(kept, one)) for one in (first, second))
    steps = steps_between(a, b, r)
    rows: list[dict[str, Any]] = [
        {
            "check": step.check.check.value,
            "sensor": step.check.sensor,
            "others": list(step.check.others),
            "theta A": statistic_at(step.before),
            "theta B": statistic_at(step.after),
            "rise": step.rise,
        }
        for step in steps
    ]
    if form != "table":
        emit(table_of(rows), form)
        return
    answer(f"A {a.calibration_id}: {len(a.recordings)} recordings; B {b.calibration_id}: {len(b.recordings)}")
    names = {one.recording_id: one.name for one in kept.recordings()}
    for where, only in (("A", set(a.recordings) - set(b.recordings)), ("B", set(b.recordings) - set(a.recordings))):
        if only:
            answer(f"only in {where}: {', '.join(shown(names.get(one, one[:_BRIEF])) for one in sorted(only))}")
    print_rows([check_in_words(row) for row in rows], _DIFF_COLUMNS, f"Thresholds at r = {r}, by the checks that count")


@command.command("promote", short_help="Put a calibration in force.")
@_id_argument
@options.store_option
@_reason_option
def promote(calibration: str, store: Path, reason: str) -> None:
    """Put a calibration in force for its rig kind. Promoting the one in force confirms it.

    \b
    auditor calibration promote 77c0ffee --reason "looked at all of its recordings"

    Judgements keep the calibration that they were reached by; auditor judge reaches new ones.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.calibrations.versions import promote as promote_version  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415

    kept = Store.open(store)
    chosen = kept.calibration(_named(kept, calibration))
    with logged(kept.folder):
        before = promote_version(kept, chosen, reason)
    instead = f" in place of {before.in_force[:_BRIEF]}" if before.in_force else ""
    how = "is confirmed" if before.in_force == chosen.calibration_id else f"is in force{instead}"
    say(
        f"calibration {chosen.calibration_id[:_BRIEF]} {how}, for {chosen.rig_kind}; auditor judge reaches new verdicts"
    )


@command.command("rollback", short_help="Return to the version of before.")
@click.argument("calibration", metavar="[ID]", required=False)
@options.store_option
@_reason_option
def rollback(calibration: str | None, store: Path, reason: str) -> Exit:
    """Return to the version that was in force before, and judge again what the withdrawn one had judged.

    \b
    auditor calibration rollback
    auditor calibration rollback 77c0ffee --reason "one of its logs was attacked"

    ID is the version in force; it is needed where there are several rig kinds. Verdicts by the version of before come
    back byte for byte. A refresh does not promote a version that was rolled back, nor use the recordings that were new
    in it, until somebody labels them clean.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.calibrations.versions import history_called, roll_back  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415

    kept = Store.open(store)
    history = history_called(kept, calibration)
    with logged(kept.folder):
        restored, judged = roll_back(kept, history, reason)
    say(
        f"calibration {restored.calibration_id[:_BRIEF]} is in force again, in place of "
        f"{_brief(history.in_force)}; {len(judged)} measurements judged again"
    )
    failed = [one for one in judged if one.judgement is None]
    for result in failed:
        say(f"{result.recording}: not judged again: {result.error or '; '.join(result.gaps)}")
    return Exit.INCOMPLETE if failed else Exit.CLEAN


@command.command("quarantine", short_help="Recordings that wait for a person.")
@options.store_option
@format_option
def quarantine(store: Path, form: str) -> None:
    """List the recordings that a refresh left out and that nobody has looked at yet, and why.

    \b
    auditor calibration quarantine
    auditor calibration quarantine --store fleet --format csv

    They are not learnt from, whatever later thresholds say of them, until somebody says that they are clean (auditor
    label ID --clean), or what was attacked.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    waiting = run_query(Store.open(store), "quarantined", {})
    nothing = "no recording waits for a person"
    emit_columns(waiting, form, _WAITING_COLUMNS, nothing, expendable=("kind", "since"), wrapped=("reason",))


@command.command("verify", short_help="Check that calibrations are what they say.")
@click.argument("calibration", metavar="[ID]", required=False)
@options.store_option
def verify(calibration: str | None, store: Path) -> Exit:
    """Check that calibrations are whole, and make them again from the store's measurements where these are there.

    \b
    auditor calibration verify
    auditor calibration verify 4be19a40 --store night/audit

    Without an ID all are checked. One line for each problem, and exit code 3 where there are any.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.calibrations.versions import problems_of, remade  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415
    from auditor.store.versions.history import histories  # noqa: PLC0415
    from auditor.store.versions.records import lost_line, lost_versions, missing_calibrations  # noqa: PLC0415

    kept = Store.open(store)
    ids = [_named(kept, calibration)] if calibration is not None else kept.ids("calibrations")
    problems = [f"{one}: {problem}" for one in ids for problem in problems_of(kept, one)]
    if calibration is None:
        every = histories(kept)
        problems += [*missing_calibrations(kept, every), *map(lost_line, lost_versions(kept, every))]
    for problem in problems:
        answer(shown(problem))
    again = sum(remade(kept, one) for one in ids)
    say(f"{len(ids)} calibrations, {again} of them made again from what was measured: {len(problems)} problems")
    return Exit.INCOMPLETE if problems else Exit.CLEAN


@command.command("export", short_help="Write a calibration to a file.")
@_id_argument
@click.argument("out", metavar="FILE", type=PATH)
@options.store_option
def export(calibration: str, out: Path, store: Path) -> None:
    """Write a calibration to a file of its own, to judge by it elsewhere: auditor scan --calibration FILE.

    \b
    auditor calibration export 4be19a40 fleet.thresholds
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.output_files import check_thresholds  # noqa: PLC0415 - keeps --help quick
    from auditor.store.calibrations import write_calibration  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    check_thresholds(out)
    kept = Store.open(store)
    write_calibration(kept.calibration(_named(kept, calibration)), out)
    answer(out)


def _named(store: "Store", beginning: str) -> str:
    """The id of the one calibration that begins so."""
    from auditor.pipeline.asking import calibration_called  # noqa: PLC0415 - keeps --help quick

    return calibration_called(store, beginning)


def _brief(calibration_id: str | None) -> str | None:
    return calibration_id and calibration_id[:_BRIEF]


def _used(row: Mapping[str, Any]) -> dict[str, object]:
    return {
        **row,
        "recording": row["name"],
        "in": row["included"],
        "findings": row["findings_by_others"],
        "look at": "yes" if row["look_at"] else None,
    }


def _condition(row: Mapping[str, Any]) -> dict[str, object]:
    """A condition as it is printed: without a share where there are too few windows to say anything."""
    shares = {name: row[name] if row["enough"] else None for name in ("share", "low", "high")}
    return {**row, "raised": row["raised_windows"], **shares}

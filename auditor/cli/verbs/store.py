"""`auditor store`: what is done to a store itself."""

import sys
from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged, reading
from auditor.cli.options import PATH
from auditor.cli.output import emit, format_option, say, shown

_store = options.store_argument_or_option(PATH, own=False)


@click.group("store", short_help="List, remove, check, compact and upgrade what a store holds.")
def command() -> None:
    """What is done to a store itself.

    \b
    auditor store list
    auditor store remove old_drive.mcap
    auditor store check
    auditor store compact
    auditor store upgrade
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines


@command.command("list", short_help="The recordings of a store.")
@_store
@format_option
def list_recordings(store: Path, form: str) -> None:
    """List the recordings of a store: names, origin, frames, verdicts, and what they have to do with each other.

    \b
    auditor store list
    auditor store list night/audit --format json

    A recording that another holds every frame of stays in the store, and counts no longer. A conflict is another
    recording with other data at the same stamps of the same sensors.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    kept = Store.open(store)
    with reading(kept.folder):
        emit(run_query(kept, "contents", {}), form)


@command.command("remove", short_help="Remove recordings from a store.")
@click.argument("recordings", nargs=-1, required=True, metavar="NAME|ID...")
@options.store_option
@click.option("--yes", is_flag=True, help="Do not ask.")
def remove(recordings: tuple[str, ...], store: Path, *, yes: bool) -> Exit:
    """Remove recordings from a store: measurements, judgements, pictures, labels and parts of evaluations.

    \b
    auditor store remove old_drive.mcap
    auditor store remove 4be19a40 77c0ffee --store night/audit --yes

    The recordings' own files are not touched. Calibrations stay, also those that were made of them.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.maintenance.relations import relate  # noqa: PLC0415
    from auditor.store.maintenance.removal import find_removable, remove_recordings  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    kept = Store.open(store)
    removable = find_removable(kept, recordings)
    names = ", ".join(f"{one.name} ({one.recording_id[:12]})" for one in removable)
    if not yes and not (sys.stdin is not None and sys.stdin.isatty()):
        say(f"{names}: nobody can be asked here, and nothing was removed; --yes removes without asking")
        return Exit.FAILED
    if not yes and not click.confirm(shown(f"remove {names} from {store}?"), err=True):
        say("nothing was removed; --yes removes without asking")
        return Exit.FAILED
    with logged(kept.folder):
        removed = remove_recordings(kept, [one.recording_id for one in removable])
        superseded = relate(kept)
    say(
        f"{store}: removed {names}: {removed.measurements} measurements, {removed.judgements} judgements, "
        f"{removed.parts} parts of evaluations"
    )
    for calibration in removed.calibrations:
        say(f"calibration {calibration} was made of what is removed; it stays")
    for recording in superseded:
        say(str(recording))
    return Exit.CLEAN


@command.command("check", short_help="Check that a store is whole.")
@_store
def check(store: Path) -> Exit:
    """Check that every file of a store is there and as it was written, fits the others, and that nothing else is there.

    \b
    auditor store check
    auditor store check night/audit

    One line for each problem, and exit code 3 where there are any.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.maintenance.verify import verify  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    kept = Store.open(store)
    problems = verify(kept).problems
    for problem in problems:
        click.echo(shown(str(problem)))
    if problems:
        say(f"{store}: {len(problems)} problem{'s' if len(problems) > 1 else ''}")
        return Exit.INCOMPLETE
    say(f"{store}: whole; {len(kept.ids('recordings'))} recordings, {len(kept.ids('measurements'))} measurements")
    return Exit.CLEAN


@command.command("compact", short_help="Make few files of many small ones.")
@_store
def compact(store: Path) -> None:
    """Put the small files of a store's recordings, measurements and judgements into few: questions take less time.

    \b
    auditor store compact
    auditor store compact night/audit

    Nothing is lost or judged anew, and other commands may use the store meanwhile. A command that is killed leaves the
    files of before, or the new ones; what it leaves behind goes the next time. Large files and pictures stay as they
    are, and so do files that are not as they were written: auditor verify names them.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.packs.packing import pack  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    kept = Store.open(store)
    with logged(kept.folder):
        packed = pack(kept)
    if not packed.files:
        say(f"{store}: there are no small files to put together")
        return
    say(f"{store}: {packed.files} files are {packed.packs} now")
    if packed.left:
        say(f"{store}: {packed.left} files are being read and stay; run the command again later to remove them")


@command.command("upgrade", short_help="Upgrade a store of an earlier version.")
@_store
def upgrade(store: Path) -> None:
    """Upgrade a store of an earlier schema version, in its place.

    \b
    auditor store upgrade
    auditor store upgrade night/audit

    Measurements, judgements and evaluations stay, with their ids. An upgrade that is killed leaves the old store or
    the new one. It needs as much room again as the store takes, and no other command may use the store meanwhile.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.maintenance.upgrade import upgrade as upgrade_store  # noqa: PLC0415 - keeps --help quick
    from auditor.store.schema import SCHEMA_VERSION  # noqa: PLC0415

    command = click.get_current_context().find_root().obj
    done = upgrade_store(store, ["auditor", *command])
    if done is None:
        say(f"{store}: it has schema version {SCHEMA_VERSION} already")
        return
    say(
        f"{store}: upgraded to schema version {SCHEMA_VERSION}: {done.measurements} measurements, "
        f"{done.judgements} judgements, {done.parts} parts of evaluations"
    )

"""`auditor verify`: whether a store or a case is as it was written."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged
from auditor.cli.options import LocalPath
from auditor.cli.output import say, shown

if TYPE_CHECKING:
    from auditor.store.log.signatures import PublicKey
    from auditor.store.maintenance.verify import VerifyResult

_key = LocalPath(exists=True, dir_okay=False)


@click.command("verify", short_help="Is a store, or a case, as it was written?")
@options.store_argument_or_option(own=False)
@click.option("--public-key", type=_key, help="Also check that the holder of this Ed25519 key (PEM) signed everything.")
@click.option(
    "--private-key",
    type=_key,
    envvar="AUDITOR_SIGNING_KEY",
    show_envvar=True,
    help="Sign the log with this Ed25519 key (PEM) where nothing differs; with the variable set, every run signs.",
)
def command(store: Path, public_key: Path | None, private_key: Path | None) -> Exit:
    """Check that every file of a store is as the run that wrote it left it, and that its log is whole.

    \b
    auditor verify
    auditor verify --store night/audit --public-key auditor.pem
    auditor verify case_39b955.zip

    Each file is hashed and compared with the log of runs, or with the row that finished it: tables, pictures, pages.
    One line for each file that differs, is missing or was added, for each line of the log that was changed or is gone,
    and for counts that no image can give. Whoever may write to the store could write all of it anew, log included:
    only signatures show that, or heads of the log that were kept elsewhere.

    Of a case (auditor case), a folder or its zip, every file is compared with its manifest; no store is needed.

    Exits with 0 where everything is as it was written, 1 where something differs, and 3 where a killed run left
    something that nobody reads.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.casefile.checking import is_case  # noqa: PLC0415 - keeps --help quick
    from auditor.store.log.signatures import public_key as read_key  # noqa: PLC0415
    from auditor.store.maintenance.verify import verify  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    key = read_key(public_key) if public_key is not None else None
    if is_case(store):
        return _verify_case(store, key)
    kept = Store.open(store)
    result = verify(kept, key)
    for problem in result.problems:
        click.echo(shown(str(problem)))
    for run in result.open_runs:
        words = " ".join(run.what.get("command", ()))
        say(f"under way, or killed: {words} since {run.at[:19]}Z on {run.what.get('host')}")
    for entry in result.altered:
        places = [one["path"] for one in entry.what["files"]]
        more = f" and {len(places) - 1} more" if len(places) > 1 else ""
        say(f"at {entry.at[:19]}Z a run found that it was altered, and wrote on: {places[0]}{more}")
    if private_key is not None and not result.grave:
        with logged(kept.folder, private_key):
            say(f"{store}: signed with {private_key}")
    say(f"{store}: {_summary(result, signed=public_key is not None)}")
    if result.grave:
        return Exit.FINDINGS
    return Exit.INCOMPLETE if result.problems else Exit.CLEAN


def _verify_case(path: Path, key: "PublicKey | None") -> Exit:
    """Check a case, which needs no store."""
    from auditor.casefile.checking import check_case  # noqa: PLC0415 - keeps --help quick

    problems = check_case(path, key)
    for problem in problems.problems:
        click.echo(shown(problem))
    count = len(problems.problems)
    sentence = f"{count} problem{'s' * (count != 1)}" if count else "everything is as it was written"
    signed = "not signed"
    if problems.signer is not None:
        checked = "signed by this key" if key is not None else "signed, which only its public key can check"
        signed = checked if not count else "signed"
    say(f"{path}: {sentence}; {problems.files} files, {signed}")
    return Exit.FINDINGS if problems.problems else Exit.CLEAN


def _summary(result: "VerifyResult", *, signed: bool) -> str:
    """One line on everything."""
    grave, left = len(result.grave), len(result.problems) - len(result.grave)
    sentence = f"{grave} problem{'s' * (grave != 1)}" if grave else "everything is as it was written"
    sentence += f", {left} left by killed runs" if left else ""
    sentence += " and signed" if signed and not grave else ""
    chains = f"{result.chains} chain{'s' * (result.chains != 1)}"
    return f"{sentence}; {result.files} files, {result.entries} entries of {chains}"

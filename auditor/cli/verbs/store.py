"""`auditor store`: what is done to a store itself."""

from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.output import say


@click.group("store", short_help="Upgrade a store of the version before.")
def command() -> None:
    """What is done to a store itself.

    \b
    auditor store upgrade
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines


@command.command("upgrade", short_help="Upgrade a store of the version before.")
@click.argument("store", type=click.Path(path_type=Path), default=options.DEFAULT_STORE)
def upgrade(store: Path) -> None:
    """Upgrade a store of the schema version before, in its place.

    \b
    auditor store upgrade
    auditor store upgrade night/audit

    Measurements, judgements and evaluations stay, with their ids. An upgrade that is killed leaves the old store or
    the new one. It needs as much room again as the store takes, and no other command may use the store meanwhile.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.marker import UPGRADED_FROM  # noqa: PLC0415 - keeps --help quick
    from auditor.store.schema import SCHEMA_VERSION  # noqa: PLC0415
    from auditor.store.upgrade import upgrade as upgrade_store  # noqa: PLC0415

    done = upgrade_store(store)
    if done is None:
        say(f"{store}: it has schema version {SCHEMA_VERSION} already")
        return
    say(
        f"{store}: upgraded from schema version {UPGRADED_FROM} to {SCHEMA_VERSION}: {done.measurements} measurements, "
        f"{done.judgements} judgements, {done.parts} parts of evaluations"
    )

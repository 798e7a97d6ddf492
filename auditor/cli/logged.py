"""The log of a store has the command line of each verb that writes to it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from auditor.store.log import Run


@contextmanager
def logged(store: Path) -> Iterator["Run"]:
    """All that is written to a store inside the block belongs to this command. Raises StoreError."""
    from auditor.store.log import run  # noqa: PLC0415 - heavy

    arguments = click.get_current_context().find_root().obj or ()
    with run(store, ["auditor", *arguments]) as entry:
        yield entry

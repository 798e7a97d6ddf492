"""The command line as a test uses it: what was printed, and how it ended."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auditor.cli import run
from auditor.store.export import encode
from auditor.store.queries import run_sql
from auditor.store.store import Store

Printed = Callable[[], tuple[bytes, bytes]]
DEFECTS = ("Traceback", "defect of auditor", "auditor failed on it", "RuntimeWarning")


@dataclass(frozen=True)
class Answer:
    """How a command ended, and what it printed."""

    code: int
    out: bytes
    err: str

    @property
    def rows(self) -> Any:
        return json.loads(self.out)


class Audit:
    """Runs verbs beside one store; no command may end in a defect."""

    def __init__(self, store: Path, printed: Printed) -> None:
        self.store = store
        self._printed = printed

    def __call__(self, verb: str, *words: object, store: bool = True) -> Answer:
        self._printed()
        code = run([verb, *map(str, words), *(["--store", str(self.store)] if store else [])])
        out, err = self._printed()
        shown = out.decode("utf-8", "replace") + err.decode()
        assert not any(word in shown for word in DEFECTS), shown
        return Answer(code, out, err.decode())

    def scan(self, *recordings: Path, how: tuple[str, ...] = ()) -> Answer:
        """A scan without pictures, for which the recording would be read again in a process of its own."""
        return self("scan", *recordings, "--pictures", "none", *how)

    def ask(self, sql: str) -> Any:
        return ask(self.store, sql)


def ask(store: Path, sql: str) -> Any:
    """The rows of an answer as they are printed, without the process that the SQL of users is run in."""
    return json.loads(encode(run_sql(Store.open(store), sql), "json"))

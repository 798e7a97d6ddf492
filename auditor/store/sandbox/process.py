"""A user's SQL in a process of its own, which can write nothing and ends at its limits."""

import json
import signal
from dataclasses import asdict
from typing import IO

import pyarrow as pa

from auditor import errors
from auditor.errors import AuditorError, QueryError
from auditor.safety.launching import start
from auditor.store.folder import StoreFolder
from auditor.store.sandbox.limits import SqlLimits

_CHILD = "auditor.store.sandbox.child"


def run_sandboxed(store: StoreFolder, text: str, limits: SqlLimits | None = None) -> pa.Table:
    """The answer to one SELECT statement of a user's own, over the views.

    It can read the store's finished files and nothing else, and write nothing. Raises QueryError where it is no single
    SELECT, is not allowed, or fails, LimitError where it takes more than it may, and StoreError where a file of the
    store cannot be read.
    """
    limits = limits or SqlLimits()
    try:
        request = json.dumps({"store": str(store.folder), "sql": text, "limits": asdict(limits)}, ensure_ascii=False)
        sent = request.encode()
    except UnicodeEncodeError as error:
        raise QueryError("it is not UTF-8", where="SQL", remedy="auditor query lists the views") from error
    with start(_CHILD, piped=True) as process:
        assert process.stdin is not None  # for the checker of types: all three are pipes
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            process.stdin.write(sent)
            process.stdin.close()
            answer = _received(process.stdout, limits)
            trouble = process.stderr.read()
        finally:
            process.kill()  # a process that has ended has no more to lose
        code = process.wait()
    if code == 0 and answer is not None:
        return answer
    raise _error(code, trouble, limits)


def _received(stream: IO[bytes], limits: SqlLimits) -> pa.Table | None:
    """The answer; None where it breaks off."""
    batches, size = [], 0
    try:
        with pa.ipc.open_stream(stream) as reader:
            for batch in reader:
                size += batch.nbytes
                if size > limits.memory_bytes:
                    raise limits.answer_too_large()
                batches.append(batch)
            return pa.Table.from_batches(batches, reader.schema)
    except (pa.ArrowException, OSError):
        return None


def _error(code: int, trouble: bytes, limits: SqlLimits) -> AuditorError:
    """Why there is no answer: what the process said, or how it ended."""
    if trouble:
        told = json.loads(trouble)
        kind: type[AuditorError] = getattr(errors, told["kind"])
        return kind(told["what"], where=told["where"], remedy=told["remedy"])
    if code == -signal.SIGALRM:
        return limits.out_of_time()
    return QueryError(f"its process died (exit code {code})", where="SQL", remedy="ask in another way")

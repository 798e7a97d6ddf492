"""The process that one SQL text of a user runs in; `process` starts it.

The request comes as JSON on its stdin, the answer leaves as Arrow's stream on its stdout, an error as JSON on its
stderr. Libraries that print find neither.
"""

import json
import os
import sys
from typing import IO, Any

import pyarrow as pa

from auditor.errors import AuditorError, QueryError
from auditor.store.folder import StoreFolder
from auditor.store.queries import stream_sql
from auditor.store.sandbox.limits import SqlLimits
from auditor.store.sandbox.rights import give_up_writing, limit


def main() -> int:
    """Answer one request; returns the exit code."""
    request = json.load(sys.stdin)
    answer, trouble = os.dup(sys.stdout.fileno()), os.dup(sys.stderr.fileno())
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nothing, stream.fileno())
    limits = SqlLimits(**request["limits"])
    give_up_writing()
    limit(limits.seconds, limits.process_bytes)
    try:
        with open(answer, "wb") as sink:  # noqa: PTH123 - a descriptor
            _send(request, limits, sink)
    except AuditorError as error:
        _tell(trouble, error)
    except MemoryError:
        _tell(trouble, limits.out_of_memory())
    except Exception as error:  # noqa: BLE001 - whatever it is: one line, as of any other query
        _tell(trouble, QueryError(" ".join(f"{type(error).__name__}: {error}".split()), where="SQL"))
    else:
        return 0
    return 1


def _send(request: dict[str, Any], limits: SqlLimits, sink: IO[bytes]) -> None:
    store = StoreFolder.open(request["store"])
    with stream_sql(store, request["sql"], limits) as batches, pa.ipc.new_stream(sink, batches.schema) as stream:
        for batch in batches:
            stream.write_batch(batch)


def _tell(trouble: int, error: AuditorError) -> None:
    told = {"kind": type(error).__name__, "what": error.what, "where": error.where, "remedy": error.remedy}
    os.write(trouble, json.dumps(told).encode())

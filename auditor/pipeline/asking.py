"""Questions to a store as `import auditor` and the command line ask them; what reads and measures is not imported."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import QueryError
from auditor.resources import is_address
from auditor.store import StoreFolder, run_query
from auditor.store import query as find_query
from auditor.store.export import Table

if TYPE_CHECKING:
    from auditor.store import Store

PathLike = str | Path


def opened(store: StoreFolder | PathLike) -> StoreFolder:
    """A store, the one in a folder, or the one at an address as it is now. Raises StoreError where there is none."""
    if isinstance(store, str) and is_address(store):
        from auditor.pipeline.remote.mirror import brought_here  # noqa: PLC0415 - it reads recordings, too

        return StoreFolder.open(brought_here(store))
    return store if isinstance(store, StoreFolder) else StoreFolder.open(store)


def query(
    store: StoreFolder | PathLike, name: str | None = None, /, *, sql: str | None = None, **parameters: object
) -> Table:
    """The answer of a query by its name and parameters, or of one SELECT statement over the store's views.

    The answer is a `pyarrow.Table`; `rows_of` makes rows of it. SQL runs in a process of its own that can write nothing
    and has 300 s and 4096 MB. Raises QueryError where there is no such query, a parameter
    does not fit, names nothing in the store, or the SQL is not allowed, LimitError where it takes more, and StoreError.
    """
    if (name is None) == (sql is None):
        raise QueryError("give the name of a query or sql, and not both", where="query")
    if sql is not None:
        from auditor.store import run_sandboxed  # noqa: PLC0415 - what starts processes

        return run_sandboxed(opened(store), sql)
    assert name is not None
    wanted, kept = find_query(name), opened(store)
    named = {one.name: parameters[one.name] for one in wanted.parameters if one.name in parameters}
    if not named.keys().isdisjoint(("recording", "calibration")):
        from auditor.store import Store  # noqa: PLC0415 - heavy

        known = Store(kept.folder)
        _refuse_unknown(known, name, named)
        parameters = _by_id(known, parameters)
    return run_query(kept, name, parameters)


def _by_id(store: "Store", parameters: Mapping[str, object]) -> dict[str, object]:
    """The parameters with the id of the one recording that is called so: by any name that it was read under."""
    called = store.recordings_called(str(parameters["recording"])) if parameters.get("recording") else []
    return {**parameters, **({"recording": called[0].recording_id} if len(called) == 1 else {})}


def _refuse_unknown(store: "Store", query: str, parameters: Mapping[str, object]) -> None:
    """Raises QueryError for a recording or calibration that the store does not have: no rows would hide it."""
    recording, calibration = parameters.get("recording"), parameters.get("calibration")
    called = [] if recording is None else store.recordings_called(str(recording))
    if recording is not None and not called:
        raise QueryError(
            f"no recording has the name or id {recording!r}",
            where=f"query {query}",
            remedy=f"auditor query summary --store {shlex.quote(str(store.folder))} lists them",
        )
    if called and all(one.superseded_by is not None for one in called):
        later = store.recording(str(called[0].superseded_by))
        raise QueryError(
            f"recording {recording!r} counts no longer: {later.name} holds every frame of it",
            where=f"query {query}",
            remedy=f"ask for recording={later.recording_id[:12]}",
        )
    if calibration is not None and not store.calibrations_called(str(calibration)):
        from auditor.pipeline.calibrations.names import listing_calibrations  # noqa: PLC0415 - heavy

        raise QueryError(
            f"no calibration has an id that begins with {calibration!r}",
            where=f"query {query}",
            remedy=listing_calibrations(store.folder),
        )

"""Questions to a store as `import auditor` and the command line ask them, and its calibrations by name.

What reads and measures is not imported.
"""

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import QueryError, SettingError, ThresholdsError
from auditor.resources import is_address
from auditor.store.connection import Connection, plain_connection
from auditor.store.export import Table
from auditor.store.folder import StoreFolder
from auditor.store.queries import list_queries, list_views, run_query
from auditor.store.queries import query as find_query

if TYPE_CHECKING:
    import pandas
    import polars

    from auditor.model.calibration import Calibration
    from auditor.store.store import Store

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
    """Answer a question to a store: a query by its name, or one SELECT statement over its views.

    Parameters
    ----------
    store
        A store, or its folder or address.
    name
        A query's, as `auditor query` lists them.
    sql
        A SELECT statement in its place. It runs in a process of its own that can write nothing and has 300 s and
        4096 MB.
    **parameters
        Those of the query.

    Returns
    -------
    pyarrow.Table
        `rows_of` makes rows of it.

    Raises
    ------
    QueryError
        There is no such query, a parameter does not fit or names nothing in the store, or the SQL is not allowed.
    LimitError
        It takes more time or memory.
    StoreError
        There is no store, or one of another version.
    """
    if (name is None) == (sql is None):
        raise QueryError("give the name of a query or sql, and not both", where="query")
    if sql is not None:
        from auditor.store.sandbox.process import run_sandboxed  # noqa: PLC0415 - what starts processes

        return run_sandboxed(opened(store), sql)
    assert name is not None
    wanted, kept = find_query(name), opened(store)
    named = {one.name: parameters[one.name] for one in wanted.parameters if one.name in parameters}
    if not named.keys().isdisjoint(("recording", "calibration")):
        from auditor.store.store import Store  # noqa: PLC0415 - heavy

        full_store = Store(kept.folder)
        _refuse_unknown(full_store, name, named)
        parameters = _by_id(full_store, parameters)
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
        raise QueryError(
            f"no calibration has an id that begins with {calibration!r}",
            where=f"query {query}",
            remedy=listing_calibrations(store.folder),
        )


def named_calibration(folder: Path, name: str | None) -> "Calibration | None":
    """The calibration of a name: a file, or an id of the store in a folder or the beginning of one; None of None.

    Raises ThresholdsError where there is none, also where there is no store yet.
    """
    from auditor.store.calibrations import read_calibration  # noqa: PLC0415 - heavy
    from auditor.store.store import Store  # noqa: PLC0415 - heavy

    if name is None:
        return None
    if Path(name).is_file():
        return read_calibration(Path(name))
    if not Store.is_at(folder):
        raise _no_calibration(name, folder, has_calibrations=False)
    store = Store.open(folder)
    return store.calibration(calibration_called(store, name))


def calibration_called(store: "Store", beginning: str) -> str:
    """The id of the one calibration that begins so. Raises ThresholdsError where there is none, or several."""
    matching = store.calibrations_called(beginning)
    if len(matching) != 1:
        raise _no_calibration(
            beginning, store.folder, has_calibrations=bool(store.ids("calibrations")), several=bool(matching)
        )
    return matching[0]


def _no_calibration(name: str, folder: Path, *, has_calibrations: bool, several: bool = False) -> ThresholdsError:
    problem = "several calibrations begin so" if several else "no calibration has that id, and no file that name"
    remedy = (
        listing_calibrations(folder) if has_calibrations else "the store has none yet: make one with auditor calibrate"
    )
    return ThresholdsError(problem, where=name or "--calibration", remedy=remedy)


def listing_calibrations(folder: Path) -> str:
    """A command that lists the calibrations of a store."""
    return f"auditor calibration list --store {shlex.quote(str(folder))} lists them"


def open_store(path: str | Path) -> "OpenedStore":
    """Open a store to ask it questions.

    Parameters
    ----------
    path
        Its folder, or an address such as s3://bucket/audit, which is asked as it is now.

    Returns
    -------
    OpenedStore
        It answers as the store is at each call.

    Raises
    ------
    StoreError
        There is none, or one of another version.
    """
    return OpenedStore(opened(path))


@dataclass(frozen=True)
class OpenedStore:
    """One store that answers as it is at each call: also after a new scan or judgement.

    `question` is the name of a query, with its parameters as keywords; the name of a view, for all of its rows; or one
    SELECT statement over the views.
    """

    store: StoreFolder

    def query(self, question: str, /, **parameters: object) -> Table:
        """Answer a question.

        Parameters
        ----------
        question
            The name of a query or a view, or one SELECT statement over the views.
        **parameters
            Those of the query.

        Returns
        -------
        pyarrow.Table
            All rows of the answer.

        Raises
        ------
        QueryError
            There is no such query or view, a parameter does not fit or names nothing in the store, or the SQL is not
            allowed.
        StoreError
            The store is gone or of another version.
        """
        if question in {known.name for known in list_queries()}:
            return query(self.store, question, sql=None, **parameters)
        if parameters:
            raise QueryError("only a query has parameters", where=question, remedy="auditor query lists the queries")
        if question in {view.name for view in list_views()}:
            return query(self.store, sql=f"FROM {question}")  # our own name
        if re.fullmatch(r"\w+", question):
            raise QueryError("there is no such query or view", where=question, remedy="auditor query lists them")
        return query(self.store, sql=question)

    def df(self, question: str, /, **parameters: object) -> "pandas.DataFrame":
        """The answer as a pandas DataFrame. Raises as `query` does, and SettingError without pandas."""
        try:
            return self.query(question, **parameters).to_pandas()
        except ModuleNotFoundError as error:
            raise _not_installed(error) from error

    def pl(self, question: str, /, **parameters: object) -> "polars.DataFrame":
        """The answer as a polars DataFrame. Raises as `query` does, and SettingError without polars."""
        try:
            import polars  # noqa: PLC0415 - not everybody has it

            return polars.DataFrame(polars.from_arrow(self.query(question, **parameters)))
        except ModuleNotFoundError as error:
            raise _not_installed(error) from error

    def connection(self) -> Connection:
        """A connection of the package duckdb, with all views of the store as it is now. Raises StoreError.

        What views and columns mean stands in `duckdb_views()` and `duckdb_columns()`. The store can be read and
        not written; tables of one's own live in the connection's memory.
        """
        return plain_connection(self.store)


def _not_installed(error: ModuleNotFoundError) -> SettingError:
    return SettingError(
        f"the package {error.name} is not installed", where="open_store", remedy=f"pip install {error.name}"
    )

"""The ledger of inputs: what became of every path that a scan was given or found.

Exit code, pages and questions say the same of what was not audited, since all of them follow from these rows.
"""

from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from auditor.errors import AuditorError, LimitError, RigError
from auditor.model.text import storable
from auditor.pipeline.many import Judged
from auditor.pipeline.measured import Measured
from auditor.resources import is_address
from auditor.store import Store
from auditor.store.records import content_id, to_utc

Row = dict[str, Any]


class Outcome(StrEnum):
    """What became of an input."""

    READ = "read"
    TWIN = "twin"
    NOT_READ = "not read"
    NO_RIG = "no rig"
    ENDED = "ended"


def keep_ledger(
    store: Store, errors: Iterable[AuditorError], measured: Iterable[Measured], judged: Iterable[Judged]
) -> None:
    """Keep a row for each input of a scan: those that ended in `errors`, and those that are `measured` and `judged`."""
    gaps: dict[str, list[str]] = {}
    for one in judged:
        said = (str(one.error),) if one.error else one.gaps
        gaps.setdefault(store.measurement(one.measurement_id).recording_id, []).extend(map(storable, said))
    rows = [*map(_failed, errors), *_read(list(measured), gaps)]
    if rows:
        moment = datetime.now(UTC)
        known = content_id("inputs", moment.isoformat(), [row["path"] for row in rows])
        store.write("inputs", known, [{"inputs_id": known, "offered_at": to_utc(moment), **row} for row in rows])


def _failed(error: AuditorError) -> Row:
    kinds = {RigError: Outcome.NO_RIG, LimitError: Outcome.ENDED}
    outcome = next((one for kind, one in kinds.items() if isinstance(error, kind)), Outcome.NOT_READ)
    return _row(*_named(error.where), outcome, reason=storable(error.what), remedy=storable(error.remedy))


def _read(measured: Sequence[Measured], gaps: dict[str, list[str]]) -> Iterator[Row]:
    """The rows of recordings that were read; of several paths of one content the later ones are twins."""
    first: dict[str, str] = {}
    for one in measured:
        known, here = one.recording_id, str(one.recording)
        there = first.setdefault(known, here)
        if there == here:
            yield _row(*_named(here), Outcome.READ, recording_id=known, gaps=gaps.get(known, ()))
        else:
            reason = f"the same content as {storable(there)}"
            yield _row(*_named(here), Outcome.TWIN, reason=reason, recording_id=known)


def _named(where: str) -> tuple[str, str]:
    """The place and the name of an input: of a path the whole one, of an address itself."""
    place = where if is_address(where) else str(Path(where).absolute())
    return place, Path(where).name


def _row(
    place: str,
    name: str,
    outcome: Outcome,
    *,
    reason: str = "",
    remedy: str = "",
    recording_id: str | None = None,
    gaps: Sequence[str] = (),
) -> Row:
    return {
        "path": storable(place),
        "name": storable(name),
        "outcome": outcome.value,
        "reason": reason or None,
        "remedy": remedy or None,
        "recording_id": recording_id,
        "gaps": list(dict.fromkeys(gaps)),
    }

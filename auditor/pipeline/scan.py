"""The scan: recordings are measured, related to those that the store has, judged, and told. Every verb that scans calls
this: `auditor scan`, `auditor refresh` and `auditor.scan`.

The ledger says what became of every path that a scan was given or found. Exit code, pages and questions say the same of
what was not audited, since all of them follow from its rows.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

from auditor.errors import AuditorError, LimitError, RigError
from auditor.model.text import storable
from auditor.pipeline.calibrations.batch import judge_batch
from auditor.pipeline.judged import JudgeResult, JudgeSettings, judge_all
from auditor.pipeline.many import Batch, measure_all
from auditor.pipeline.measured import MeasureResult, MeasureTask
from auditor.pipeline.pictures import picture_incidents
from auditor.pipeline.remote.mirror import put_back_if_due
from auditor.pipeline.workers import Outcome
from auditor.resources import is_address
from auditor.store.log.runs import logged
from auditor.store.maintenance.relations import relate
from auditor.store.packs.packing import pack_where_many
from auditor.store.records import content_id, to_utc
from auditor.store.store import Store

Row = dict[str, Any]


class InputOutcome(StrEnum):
    """What became of an input."""

    READ = "read"
    TWIN = "twin"
    NOT_READ = "not read"
    NO_RIG = "no rig"
    ENDED = "ended"


def keep_ledger(
    store: Store, errors: Iterable[AuditorError], measured: Iterable[MeasureResult], judged: Iterable[JudgeResult]
) -> None:
    """Keep a row for each input of a scan: those that ended in `errors`, and those that are `measured` and `judged`."""
    gaps: dict[str, list[str]] = {}
    for result in judged:
        said = (str(result.error),) if result.error else result.gaps
        gaps.setdefault(store.measurement(result.measurement_id).recording_id, []).extend(map(storable, said))
    rows = [*map(_failed, errors), *_read(list(measured), gaps)]
    if rows:
        moment = datetime.now(UTC)
        inputs_id = content_id("inputs", moment.isoformat(), [row["path"] for row in rows])
        store.write(
            "inputs", inputs_id, [{"inputs_id": inputs_id, "offered_at": to_utc(moment), **row} for row in rows]
        )


def _failed(error: AuditorError) -> Row:
    kinds = {RigError: InputOutcome.NO_RIG, LimitError: InputOutcome.ENDED}
    outcome = next((one for kind, one in kinds.items() if isinstance(error, kind)), InputOutcome.NOT_READ)
    return _row(*_named(error.where), outcome, reason=storable(error.what), remedy=storable(error.remedy))


def _read(measured: Sequence[MeasureResult], gaps: dict[str, list[str]]) -> Iterator[Row]:
    """The rows of recordings that were read; of several paths of one content the later ones are twins."""
    first: dict[str, str] = {}
    for result in measured:
        recording_id, here = result.recording_id, str(result.recording)
        there = first.setdefault(recording_id, here)
        if there == here:
            yield _row(*_named(here), InputOutcome.READ, recording_id=recording_id, gaps=gaps.get(recording_id, ()))
        else:
            reason = f"the same content as {storable(there)}"
            yield _row(*_named(here), InputOutcome.TWIN, reason=reason, recording_id=recording_id)


def _named(where: str) -> tuple[str, str]:
    """The place and the name of an input: of a path the whole one, of an address itself."""
    place = where if is_address(where) else str(Path(where).absolute())
    return place, Path(where).name


def _row(
    place: str,
    name: str,
    outcome: InputOutcome,
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


class Scan:
    """One scan of a batch into the store of a folder, step by step: `measure`, `judge`, and `finish`.

    Each step yields what became of each recording as it is known. `batch` is what is scanned. `errors` are those of
    inputs that could not be measured, `measured` what could, in the order given, and `judged` what became of each
    measurement.
    """

    def __init__(self, batch: Batch, folder: Path) -> None:
        self.batch, self._folder = batch, folder
        self._results: dict[MeasureTask, list[MeasureResult]] = {}
        self.errors: list[AuditorError] = list(batch.errors)
        self.judged: list[JudgeResult] = []

    def logged(self) -> AbstractContextManager[object]:
        """What its steps write has one entry in the store's log; there is none where nothing will be written."""
        return logged(self._folder) if self.batch.tasks or Store.is_at(self._folder) else nullcontext()

    @property
    def _is_whole(self) -> bool:
        """False for a shard: what needs all recordings is done once, when all shards are done."""
        return self.batch.settings.shard is None

    @property
    def measured(self) -> list[MeasureResult]:
        """The recordings that the store has, in the order given."""
        return [one for task in self.batch.tasks for one in self._results.get(task, ())]

    @cached_property
    def store(self) -> Store | None:
        """The store; None where there is none, since nothing was ever measured into it."""
        return self.batch.store or (Store.open(self._folder) if Store.is_at(self._folder) else None)

    @property
    def measurement_ids(self) -> list[str]:
        """The measurements of all recordings, in the order given."""
        return [known for one in self.measured for known in one.measurement_ids]

    def measure(self, on_progress: Callable[[object, str, int], None]) -> Iterator[Outcome[MeasureTask, MeasureResult]]:
        """Measure the recordings, each in a process of its own, as `measure_all`."""
        for outcome in measure_all(self.batch, on_progress):
            if outcome.error is not None:
                self.errors.append(outcome.error)
            elif outcome.result is not None:
                self._results.setdefault(outcome.item.given or outcome.item, []).append(outcome.result)
                put_back_if_due(self._folder)
            yield outcome

    def relate(self) -> Iterator[str]:
        """Relate what was measured to the store's other recordings: a sentence for each that another one holds."""
        related = self.store is not None and self._results and self._is_whole
        yield from map(str, relate(self.store) if related and self.store is not None else ())

    def judge(self, settings: JudgeSettings, only: Collection[str] | None = None) -> Iterator[JudgeResult]:
        """Judge what was measured, by each other where nothing fits, or `only` these measurements one by one; verdicts
        that would be the same are kept. Where another recording counts in place of one, both are judged.
        """
        store, judging = self.store, replace(settings, only_stale=True)
        if store is None or not self._is_whole:
            return
        ids = [*self.measurement_ids, *self._counted(store)] if only is None else list(only)
        for result in judge_batch(store, ids, judging) if only is None else judge_all(store, ids, judging):
            self.judged.append(result)
            yield result

    def _counted(self, store: Store) -> Iterator[str]:
        """The measurements of other recordings that count in place of some of the batch."""
        given, counted = {one.recording_id for one in self.measured}, store.counted_by() if self._results else {}
        others = {counted[one] for one in given & counted.keys()} - given
        if others:
            yield from (one.measurement_id for one in store.measurements() if one.recording_id in others)

    def finish(self) -> Iterator[str]:
        """Keep the ledger of inputs, pack small files, and picture what was found; yields what people are to know."""
        store = self.store
        if store is None:
            return
        keep_ledger(store, self.errors, self.measured, self.judged)
        if self._is_whole and (packed := pack_where_many(store)).files:
            yield f"{self._folder}: {packed.files} small files are {packed.packs} now, as by auditor store compact"
        ids = [one.measurement_id for one in self.judged if one.found and (self.batch.shows_known or one.fresh)]
        how, limits = self.batch.settings, self.batch.limits
        pictured = picture_incidents(store, ids, how.pictures, limits, how.jobs, self.batch.spool) if ids else ()
        yield from (f"{one.recording}: {one.remark}" for one in pictured if one.remark)
        self.batch.spool.close()

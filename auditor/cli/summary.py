"""What an audit prints: what became of each recording, one row a recording, the incidents, and a line that closes."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auditor.cli.audit_tables import show_incidents, show_recordings
from auditor.cli.exit_codes import Exit, NotAudited, Tally
from auditor.cli.output import answer, emit, progress, say, write_bytes
from auditor.model.text import first_few, storable

if TYPE_CHECKING:
    from auditor.errors import AuditorError
    from auditor.pipeline.judged import JudgeResult
    from auditor.pipeline.many import Batch
    from auditor.pipeline.measured import MeasureResult
    from auditor.pipeline.scan import Scan
    from auditor.store.export import Table
    from auditor.store.records import StoredJudgement
    from auditor.store.store import Store

_ONCE = "the same command without --shard relates, judges and shows them, and reads nothing again"
_MOST_NAMED = 3

Remarks = dict[tuple[str, str], list[str]]
"""The names of the recordings that a remark on a rig kind holds for."""


def show_measuring(scan: "Scan", tally: Tally) -> None:
    """Measure the batch of a scan, and print what became of each recording."""
    from auditor.pipeline.many import was_examined  # noqa: PLC0415 - keeps --help quick

    batch = scan.batch

    notes = (f"{note}: it is text and no recording, and was not read" for note in batch.notes)
    for remark in (*batch.remarks, *notes):
        say(remark)
    for error in batch.errors:
        say(f"auditor: {error}")
        _leave(tally, error.where, error)
    _say_remote(batch)
    with progress(len(batch.tasks), "measuring", {task: task.size_bytes for task in batch.tasks}) as (
        advanced,
        finished,
    ):
        for outcome in scan.measure(advanced):
            if outcome.error is not None:
                finished(f"auditor: {outcome.error}", of=outcome.item)
                tally.incomplete |= was_examined(outcome.error)
                _leave(tally, str(outcome.item), outcome.error)
            elif outcome.result is not None:
                how = "measured" if outcome.result.fresh else "measured before"
                if batch.shows_known or outcome.result.fresh:
                    rigs = len(outcome.result.measurement_ids)
                    by = f", by {rigs} rigs" if rigs > 1 else ""
                    finished(f"{outcome.item}: {outcome.result.frames} frames {how}{by}", of=outcome.item)
                else:
                    finished(of=outcome.item)
    before = sum(not one.fresh for one in scan.measured)
    if before and not batch.shows_known:
        say(f"{_count(before)} measured before")
    remarks: Remarks = {}
    for result in scan.measured:
        tally.recordings.add(result.recording_id)
        for warning in (*result.calibration_warnings, *result.remarks):
            remarks.setdefault(("", f"WARNING: {warning}"), []).append(str(result.recording))
    _say_once(remarks)


def _say_remote(batch: "Batch") -> None:
    """Say which room copies of what lies on object stores take."""
    sizes = [task.location.size_bytes for task in batch.remote]
    if sizes:
        room = f"at most {batch.spool.room_bytes / 1e6:.0f} MB in {batch.spool.above}"
        say(f"{_count(len(sizes))} of {sum(sizes) / 1e6:.0f} MB on object stores: copied while they are read, {room}")


def show_unjudged(measured: "Sequence[MeasureResult]", tally: Tally) -> None:
    """Say that recordings were measured only."""
    if measured:
        say("measured only: no verdicts were reached; auditor judge reaches them")
        tally.incomplete = True
    for result in measured:
        name, path = storable(result.recording.name), storable(str(result.recording))
        tally.not_audited.append(NotAudited(name, path, ("measured only",)))


def show_shard(shard: str, scan: "Scan", tally: Tally) -> None:
    """Say what a shard measured: it ends well where it measured all of its recordings."""
    failed = f", {_count(len(tally.not_audited))} could not be" if tally.not_audited else ""
    say(f"shard {shard}: {_count(len(scan.measured))} measured{failed}; when all shards are done, {_ONCE}")
    tally.audited |= bool(scan.measured)


def show_judging(results: "Iterable[JudgeResult]", store: "Store | None", tally: Tally) -> "list[JudgeResult]":
    """Print what could not be judged or not fully audited, and why; return what became of each measurement that counts.

    Where another recording holds every frame of one, that one counts, and what is found in it.
    """
    judged, counting = list(results), []
    remarks: Remarks = {}
    said: set[tuple[str, tuple[str, ...]]] = set()
    counted = store.counted_by() if store is not None and judged else {}
    for result in judged:
        assert store is not None, "what is judged was measured into a store"
        measurement = store.measurement(result.measurement_id)
        counts_as = counted.get(measurement.recording_id, measurement.recording_id)
        kind = str(store.rig(measurement.rig_id).kind)
        for remark in (*result.warnings, *([str(result.error)] if result.error else [])):
            remarks.setdefault((kind, remark), []).append(result.recording)
        tally.recordings.discard(measurement.recording_id)
        tally.recordings.add(counts_as)
        if counts_as == measurement.recording_id:
            counting.append(result)
            tally.found |= result.found
            if result.judgement is not None and result.found:
                graded = tally.with_incidents if result.judgement.in_incidents else tally.with_alerts
                graded.add(counts_as)
        gaps = (result.error.what,) if result.error else tuple(result.gaps)
        if gaps and (counts_as, gaps) not in said:
            said.add((counts_as, gaps))
            path = store.recording(measurement.recording_id).path
            tally.not_audited.append(NotAudited(result.recording, path, gaps))
        tally.failed |= result.error is not None
        tally.incomplete |= result.error is None and not result.complete
        tally.audited |= result.judgement is not None
    _say_once(remarks)
    return counting


def show_audit(
    store: "Store | None",
    form: str,
    tally: Tally,
    judged: "Sequence[JudgeResult] | None" = None,
    *,
    show_known: bool = True,
    measured: "Sequence[MeasureResult]" = (),
) -> None:
    """Print the summary of a store, with the incidents in it and a closing line.

    `measured` says where recordings lie that were read just now; the store knows where the others were read last.
    `judged` is what became of the measurements of a scan: what was judged now is shown, or all where nothing was and
    `show_known`, and the store is asked about it alone; earlier verdicts are counted. Recordings all of whose
    incidents are excused do not count as found. Without a store nothing was measured.
    """
    from auditor.recordings import located  # noqa: PLC0415 - keeps --help quick
    from auditor.store.export import rows_of  # noqa: PLC0415 - DuckDB is heavy
    from auditor.store.queries import query, run_sqls  # noqa: PLC0415 - DuckDB is heavy

    rows: list[dict[str, Any]] = []
    incidents: list[dict[str, Any]] = []
    if store is not None:
        asked = store if judged is None else _asked(store, judged, show_known=show_known)
        questions = {"summary": query("summary")}
        if judged is None or any(one.found for one in judged):  # it takes longer than all else that a clean scan asks
            questions["incidents"] = query("incidents")
        answers = run_sqls(asked, questions)
        summary = answers["summary"]
        rows = _with_provenance(rows_of(summary), judged or ())
        measurements = {row["measurement_id"] for row in rows}
        incidents = _with_excuses(answers["incidents"], measurements) if "incidents" in answers else []
        earlier = {one.measurement_id: one.judgement for one in judged or () if one.found and one.judgement is not None}
        for measurement_id in measurements:
            earlier.pop(measurement_id, None)
        _excuse(tally, [*incidents, *_incidents_of(store, earlier)])
        if form in ("csv", "parquet"):
            emit(summary, form)
            return
    if form == "table":
        if store is not None and (rows or not judged):
            show_recordings(rows)
            show_incidents(rows, incidents)
        answer(closing_line(tally, _raised(rows, tally), _audited_shares(rows)))
    elif form == "json":
        places = {result.recording_id: storable(located(result.recording).place) for result in measured}
        _show_json([{**row, "path": _path(store, places, row)} for row in rows], incidents, tally)


def _path(store: "Store | None", places: Mapping[str, str], row: Mapping[str, Any]) -> str | None:
    recording_id = row["recording_id"]
    return places.get(recording_id) or (store.recording(recording_id).path if store is not None else None)


def _with_provenance(rows: "Sequence[Mapping[str, Any]]", judged: "Sequence[JudgeResult]") -> list[dict[str, Any]]:
    """The rows with what each was judged `by`: as `judged` says, else the prior or what was learnt."""
    by = {result.measurement_id: result.by for result in judged}
    return [{**row, "by": by.get(row["measurement_id"]) or _provenance(row["calibration_id"])} for row in rows]


def _provenance(calibration_id: str | None) -> str | None:
    from auditor.model.calibration import PRIOR  # noqa: PLC0415 - keeps --help quick
    from auditor.model.verdict import JudgedBy  # noqa: PLC0415

    if calibration_id is None:
        return None
    return JudgedBy.PRIOR if calibration_id == PRIOR else JudgedBy.LEARNT


def _incidents_of(store: "Store", judged: "Mapping[str, StoredJudgement]") -> list[dict[str, Any]]:
    """The incidents of some measurements by their judgements; none where no review could excuse any."""
    from auditor.store.queries import run_query  # noqa: PLC0415 - DuckDB is heavy

    if not judged or not store.ids("reviews"):
        return []
    judgements = {one.judgement_id for one in judged.values()}
    kept = store.only(measurements=judged.keys(), judgements=judgements)
    return _with_excuses(run_query(kept, "incidents"), judged)


def _with_excuses(incidents: "Table", measurements: Collection[str]) -> list[dict[str, Any]]:
    """Those of the incidents that are of some measurements, each with its `excuse`: None where it fails."""
    from auditor.store.export import rows_of  # noqa: PLC0415 - DuckDB is heavy
    from auditor.store.reviews import excuse  # noqa: PLC0415

    rows = [row for row in rows_of(incidents) if any(part["measurement_id"] in measurements for part in row["parts"])]
    return [{**row, "excuse": excuse(row) or None} for row in rows]


def _excuse(tally: Tally, incidents: Sequence[Mapping[str, Any]]) -> None:
    """Leave out of what was found the recordings all of whose incidents are excused."""
    failing = {part["recording_id"] for row in incidents if not row["excuse"] for part in row["parts"]}
    excused = {part["recording_id"] for row in incidents if row["excuse"] for part in row["parts"]} - failing
    count = tally.with_incidents | tally.with_alerts
    tally.excused = count & excused
    tally.found = tally.found and bool(count - tally.excused)


def _show_json(rows: Sequence[Mapping[str, Any]], incidents: Sequence[Mapping[str, Any]], tally: Tally) -> None:
    from auditor.store.export import as_json  # noqa: PLC0415 - DuckDB is heavy

    left = [{"recording": one.recording, "path": one.path, "reason": one.reason} for one in tally.not_audited]
    write_bytes(as_json({"recordings": rows, "incidents": incidents, "not_audited": left}))


def _raised(rows: "Sequence[Mapping[str, Any]]", tally: Tally) -> int:
    """How many frames are findings in recordings that have neither an incident nor an alert."""
    quiet = (row for row in rows if row["recording_id"] not in tally.with_incidents | tally.with_alerts)
    return sum(row[kind] or 0 for row in quiet for kind in ("attacked", "unidentified", "suspect"))


def _audited_shares(rows: "Sequence[Mapping[str, Any]]") -> list[tuple[float, ...]]:
    """Of each recording the shares of its frames that its rigs audited."""
    shares: dict[str, tuple[float, ...]] = {}
    for row in rows:
        if row["audited_share"] is not None:
            shares[row["recording_id"]] = (*shares.get(row["recording_id"], ()), row["audited_share"])
    return list(shares.values())


def closing_line(tally: Tally, raised: int = 0, shares: Collection[tuple[float, ...]] = ()) -> str:
    """How many recordings there were, how many have incidents or alerts, how many were not fully audited, and why.

    `raised` are single frames that are findings beside them, `shares` those of the frames of each recording that its
    rigs audited.
    """
    if tally.exit_code() is Exit.FAILED:
        return f"nothing was audited: {_reasons(tally.not_audited)}"
    line = f"{_count(len(tally.recordings))}: {len(tally.with_incidents) or 'none'} with incidents"
    if alerts := tally.with_alerts - tally.with_incidents:
        line += f", {len(alerts)} with alerts alone"
    if tally.excused:
        line += f" ({len(tally.excused)} of them excused)"
    if raised:
        line += f", {raised} single frame{'s' * (raised > 1)} raised"
    if left := {one.path for one in tally.not_audited}:
        return f"{line}, {len(left)} not fully audited: {_reasons(tally.not_audited)}"
    return f"{line}, {_how_fully(shares)}" if tally.audited else line


def _how_fully(shares: Collection[tuple[float, ...]]) -> str:
    """How much of recordings was audited that have as much as is asked for."""
    least = min((max(of_rigs) for of_rigs in shares), default=1.0)
    if least < 1:
        return f"all audited as far as is asked for: at least {100 * least:.1f} % of the frames of each"
    partly = any(min(of_rigs) < 1 for of_rigs in shares)
    return "all fully audited by at least one rig" if partly else "all fully audited"


def _reasons(left: Sequence[NotAudited]) -> str:
    """The most frequent reasons why recordings were not fully audited, each said once of a recording."""
    said = {(one.path, _in_short(reason)): None for one in left for reason in one.gaps}
    why = Counter(reason for _, reason in said).most_common()
    several = len(why) > 1 and len({path for path, _ in said}) > 1
    reasons = ", ".join(f"{reason} ({count})" if several else reason for reason, count in why[:_MOST_NAMED])
    others = len(why) - _MOST_NAMED
    return f"{reasons}, and {others} other reason{'s' * (others > 1)}" if others > 0 else reasons


def _in_short(reason: str) -> str:
    """The first clause of a reason; a sensor's name alone is none."""
    name, colon, rest = reason.split(";", maxsplit=1)[0].partition(":")
    of_sensor = name.startswith("S_") and " is " not in name
    return f"{name}{colon}{rest.split(',')[0]}" if of_sensor else name


def _leave(tally: Tally, place: str, error: "AuditorError") -> None:
    """A recording at a path or an address could not be measured."""
    tally.failed = True
    tally.recordings.add(place)
    tally.not_audited.append(NotAudited(storable(Path(place).name), storable(place), (storable(error.what),)))


def _say_once(remarks: Remarks) -> None:
    """Each remark on one line, with the recordings that it holds for; their rig kind, where there are several."""
    several = len({kind for kind, _ in remarks}) > 1
    said = Counter((name, remark) for (_, remark), names in remarks.items() for name in set(names))
    for (kind, remark), all_names in remarks.items():
        names = sorted(set(all_names))
        if len(names) == 1:
            of_rig = f" ({kind})" if said[names[0], remark] > 1 else ""
            say(f"{names[0]}{of_rig}: {remark}")
        else:
            say(f"{_count(len(names))}{f' of {kind}' if several else ''} ({first_few(names, _MOST_NAMED)}): {remark}")


def _asked(store: "Store", judged: "Sequence[JudgeResult]", *, show_known: bool) -> "Store":
    """The part of a store that is shown after a scan; of what keeps its verdicts from earlier, the number is said.

    It is shown itself where nothing was judged now and `show_known`.
    """
    verdicts = [one for one in judged if one.judgement is not None]
    now = [one for one in verdicts if one.fresh] or (verdicts if show_known else [])
    failed = [one.measurement_id for one in judged if one.judgement is None]
    before = store.current_judgements() if failed else {}
    shown = [one.measurement_id for one in now] + [one for one in failed if one not in before]
    if earlier := len(judged) - len(shown):
        count = "1 measurement keeps its" if earlier == 1 else f"{earlier} measurements keep their"
        say(f"{count} verdicts from earlier, not shown here; auditor query summary shows them")
    return store.only(
        recordings={store.measurement(one).recording_id for one in shown},
        measurements=set(shown),
        judgements={one.judgement.judgement_id for one in now if one.judgement is not None},
    )


def _count(recordings: int) -> str:
    return f"{recordings} recording{'' if recordings == 1 else 's'}"

"""One refresh of a store: judge what is new, learn for each rig kind, and put in force what may be."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

from auditor.errors import AuditorError
from auditor.model.settings import Criteria
from auditor.pipeline.calibrations.versions import extent_of, version_of
from auditor.pipeline.geometry import rigs_through
from auditor.pipeline.judged import JudgeSettings
from auditor.pipeline.refreshing.learning import Learnt, known_of, learn
from auditor.pipeline.refreshing.pool import groups_of
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.finding import find_all
from auditor.pipeline.remote.spool import Spool, named_as_given
from auditor.recordings import Location, open_recording, survey
from auditor.store.reviews import false_alarms
from auditor.store.store import Store
from auditor.store.versions.decisions import (
    Decision,
    Failure,
    PlannedRecording,
    QuarantineEntry,
    Refresh,
    RefreshOutcome,
    write_quarantine,
)
from auditor.store.versions.history import EntryIntoForce, calibrations_in_force, put_in_force
from auditor.store.versions.records import (
    CalibrationVersion,
    UsedRecording,
    VersionOutcome,
    read_version,
    write_version,
)


def plan(
    recordings: Sequence[Path | Address], store: Store, rig_file: Path | None = None
) -> Iterator[PlannedRecording]:
    """The recordings at some places, each with its rig kinds, and whether the store has measured it."""
    search, spool = find_all(recordings), Spool()
    for error in search.errors:
        yield PlannedRecording(str(error.where), (), measured=False, error=str(error))
    measured = {one.recording_id for one in store.measurements()}
    for location in search.recordings:
        try:
            with spool.copied(location) as copies:
                yield from (_planned(one, measured, rig_file) for one in copies)
        except AuditorError as error:
            yield PlannedRecording(str(location), (), measured=False, error=str(error))
    spool.close()


def _planned(location: Location, measured: set[str], rig_file: Path | None) -> PlannedRecording:
    try:
        with open_recording(location) as recording:
            rigs = rigs_through(recording, survey(recording), rig_file).rigs
            kinds = dict.fromkeys(str(one.rig.kind) for one in rigs)
            return PlannedRecording(str(location), tuple(kinds), measured=recording.recording_id in measured)
    except AuditorError as error:
        return PlannedRecording(str(location), (), measured=False, error=str(named_as_given(error, location)))


def new_ones(store: Store, r: Decimal, no_sensors: Collection[str] = ()) -> tuple[JudgeSettings, list[str]]:
    """What was never judged, and how a night judges it: what is found is on the incident page from then on."""
    judgements = store.current_judgements()
    new = [one for one in store.ids("measurements") if one not in judgements]
    return JudgeSettings(Criteria(r, no_sensors=tuple(no_sensors))), new


def refresh(
    store: Store,
    others: Sequence[Store],
    named: Collection[str],
    r: Decimal,
    *,
    measured: Sequence[str] = (),
    judged: Collection[str] = (),
    failed: Sequence[Failure] = (),
    no_sensors: Collection[str] = (),
    dry_run: bool = False,
) -> Refresh:
    """Learn from what a store, and others beside it, have measured, and put in force what may be.

    `named` are the measurements that this call names clean. `measured` are those that were measured for it, `judged`
    those that it judged for the first time,
    `failed` those that could not be; `no_sensors` are topics that are neither cameras nor LiDARs. A rig kind that fails
    is one that failed; the others go on. With `dry_run` nothing is written. Raises StoreError.
    """
    decisions, failures = list[Decision](), list(failed)
    in_force = calibrations_in_force(store)
    for group in groups_of((store, *others), named, no_sensors):
        try:
            state = known_of(store, group)
            learnt = learn(group, state, in_force, r)
            if not dry_run:
                write_quarantine(store, group.history, waiting_after(learnt.decision, state.waiting, datetime.now(UTC)))
                _carry_out(store, learnt, r)
        except AuditorError as error:
            failures.append(Failure(str(group.history.rig_kind), str(error)))
            continue
        decisions.append(_as_it_is(learnt.decision) if dry_run else learnt.decision)
    to_review = tuple(_to_be_looked_at(store, decisions, {*measured, *judged}))
    now = datetime.now(UTC)
    return Refresh(store.folder, now, r, dry_run, tuple(measured), tuple(failures), tuple(decisions), to_review)


def _to_be_looked_at(store: Store, decisions: Sequence[Decision], new: Collection[str]) -> Iterator[UsedRecording]:
    """The new measurements that a person should look at, and those in whose incidents nobody has looked yet."""
    current, reviewed = store.current_judgements(), false_alarms(store)
    why = {one.measurement_id: one.reason for decision in decisions for one in decision.look_at}
    for used in sorted((one for decision in decisions for one in decision.recordings), key=lambda one: one.name):
        measurement = used.measurement_id
        if measurement not in new:
            continue
        told = current[measurement].found if measurement in current else 0
        if measurement in why:
            yield replace(used, reason=why[measurement])
        elif told and measurement not in reviewed and not store.given_labels(used.recording_id):
            learnt = "; it is learnt from: clean drives have as many by chance" if used.included else ""
            yield replace(used, reason=f"{told} frames of it are in incidents or alerts{learnt}")


def _as_it_is(decision: Decision) -> Decision:
    """The decision of a dry run: what would be promoted is not in force."""
    return replace(decision, in_force=decision.before)


def _carry_out(store: Store, learnt: Learnt, r: Decimal) -> None:
    """Keep a candidate and how it was made; where it is promoted the last thing written puts it in force."""
    decision, calibration = learnt.decision, learnt.calibration
    if calibration is None:
        return
    store.write_calibration(calibration)
    version = version_of(
        calibration,
        extent_of(calibration),
        decision.recordings,
        r,
        made_by="refresh",
        parent=decision.before,
        outcome=VersionOutcome(decision.decided.value),
        reasons=decision.reasons,
        provisional=decision.provisional,
        conditions=decision.conditions,
    )
    if _says_more(read_version(store, calibration.calibration_id), version):
        write_version(store, version)
    if decision.decided is RefreshOutcome.PROMOTED:
        put_in_force(store, calibration, EntryIntoForce.REFRESHED, "; ".join(decision.reasons), after=decision.before)


def waiting_after(decision: Decision, before: Mapping[str, QuarantineEntry], now: datetime) -> list[QuarantineEntry]:
    """The recordings that wait for a person after a decision, by name; what waited before keeps its time, and where it
    was named clean since, its reason.

    One that was judged, and that no store has just now, waits on.
    """
    entries = [
        QuarantineEntry(
            one.recording_id,
            one.measurement_id,
            one.name,
            one.vehicle,
            one.day,
            one.frames,
            one.findings_by_others,
            before[one.recording_id].reason if one.included and one.recording_id in before else one.reason,
            judged=one.findings_by_others is not None,
            since=before[one.recording_id].since if one.recording_id in before else now,
        )
        for one in decision.look_at
    ]
    seen = {one.recording_id for one in decision.recordings}
    entries += [one for one in before.values() if one.judged and one.recording_id not in seen]
    return sorted(entries, key=lambda one: (one.name, one.recording_id))


def _says_more(old_version: CalibrationVersion | None, version: CalibrationVersion) -> bool:
    """Whether a version is new, or another was decided of it; that one came into force is never forgotten."""
    if old_version is None:
        return True
    if old_version.outcome is VersionOutcome.PROMOTED is not version.outcome:
        return False
    return (old_version.outcome, old_version.reasons) != (version.outcome, version.reasons)


def default_page(store: Path) -> Path:
    """Where the page of a store's refreshes lies."""
    return store / "reports" / "refresh.html"

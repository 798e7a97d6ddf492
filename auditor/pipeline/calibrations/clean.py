"""Which measurements a calibration learns from: those that somebody named, and those that stores found clean."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from auditor.pipeline.judge import counted_earlier
from auditor.pipeline.judged import recording_name
from auditor.store.records import RecordingRecord, StoredJudgement
from auditor.store.reviews import false_alarms
from auditor.store.store import Store


@dataclass(frozen=True)
class CleanMeasurements:
    """Measurements to calibrate on, each with its store, and those that are left `out`, each with the reason."""

    chosen: tuple[tuple[Store, str], ...]
    out: tuple[tuple[Store, str, str], ...]

    @property
    def left_out(self) -> tuple[str, ...]:
        """A sentence for each measurement that is left out."""
        return tuple(f"{recording_name(store, one)}: left out: {reason}" for store, one, reason in self.out)


def choose_clean(given: Sequence[tuple[Store, str]], stores: Sequence[Store]) -> CleanMeasurements:
    """The measurements `given` as clean and those that `stores` hold beside them.

    Left out is what carries the ground truth of an attack; of which another recording holds every frame, where that is
    there as well; and, of the stores', what was counted in an earlier way, and what their current verdicts put into
    incidents or alerts, unless all of these were reviewed as false alarms.
    """
    measurements = {measurement for _, measurement in given}
    named = {store.measurement(one).recording_id for store, one in given}
    reasons = [(store, one, reason) for store in stores for one, reason in _of_store(store, measurements)]
    for store, measurement in given:
        recording = store.recording(store.measurement(measurement).recording_id)
        reasons.append(
            (store, measurement, attacked_by_labels(store, measurement) or held_by(store, recording, among=named))
        )
    chosen = tuple((store, one) for store, one, reason in reasons if not reason)
    return CleanMeasurements(chosen, tuple(one for one in reasons if one[2]))


def _of_store(store: Store, given: set[str]) -> Iterator[tuple[str, str]]:
    """What a store holds beside the measurements `given`, each with the reason to leave it out, or none."""
    judgements, excused = store.current_judgements(), false_alarms(store)
    recordings = {one.recording_id: one for one in store.recordings()}  # at once: one by one takes far longer
    for stored in store.measurements():
        measurement = stored.measurement_id
        if measurement not in given:
            reason = attacked_by_labels(store, measurement) or held_by(store, recordings[stored.recording_id])
            reason = reason or ("it was measured by an earlier way of counting" * counted_earlier(store, measurement))
            reason = reason or ("its verdicts are withheld" * bool(stored.withheld))
            yield measurement, reason or (_found(judgements.get(measurement)) * (measurement not in excused))


def attacked_by_labels(store: Store, measurement: str) -> str:
    """That labels say that the recording of a measurement was attacked; empty where none does."""
    recording_id = store.measurement(measurement).recording_id
    if store.labels(recording_id):
        return "it carries the ground truth of an attack"
    given = any(label.attack is not None for label in store.given_labels(recording_id))
    return "it was labelled as attacked" if given else ""


def held_by(store: Store, recording: RecordingRecord, among: Collection[str] | None = None) -> str:
    """That another recording, `among` some, holds every frame of one; empty where none does."""
    later = recording.superseded_by
    if later is None or (among is not None and later not in among):
        return ""
    return f"{store.recording(later).name} holds every frame of it"


def _found(judgement: StoredJudgement | None) -> str:
    if judgement is None or not judgement.found:
        return ""
    count = judgement.found
    return (
        f"by its current verdicts (method {judgement.method}, r = {judgement.r}) "
        f"{count} frame{' is' if count == 1 else 's are'} in incidents or alerts; if it is known to be clean, give the "
        "recording itself, or judge the store again (auditor judge) where the verdicts were wrong"
    )

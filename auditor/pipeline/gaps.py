"""What of a stored recording was not audited, a sentence each."""

from collections.abc import Iterator

from auditor.model.verdict import VerdictKind
from auditor.pipeline.reading import MIN_COVERAGE, FrameCount, Reading, judge_reading
from auditor.store import RecordingRecord, Store, StoredJudgement, StoredMeasurement


def reading_of(measurement: StoredMeasurement, min_coverage: float = MIN_COVERAGE) -> Reading:
    """Whether the recording of a measurement was read whole."""
    frames = FrameCount(measurement.measured, measurement.skipped)
    return judge_reading(frames, measurement.coverage, measurement.balance, measurement.damage, min_coverage)


def frames_short(measurement: StoredMeasurement, judgement: StoredJudgement, min_coverage: float) -> Iterator[str]:
    """Whether too few frames of a recording could be judged."""
    audited = sum(count for kind, count in judgement.counts.items() if kind is not VerdictKind.NOT_AUDITABLE)
    due = FrameCount(measurement.measured, measurement.skipped).due
    if audited < min_coverage * due:
        yield f"{audited} of {due} frames audited"


def conflicts_of(store: Store, recording: RecordingRecord) -> tuple[str, ...]:
    """One sentence on the recordings that have other data at the same stamps; none where there are none."""
    others = [store.recording(other) for other in recording.conflicts or () if store.has_recording(other)]
    names = ", ".join(f"{other.name} ({other.recording_id[:12]})" for other in others if other.superseded_by is None)
    if not names:
        return ()
    return (
        f"conflict with {names}: the same stamps of the same sensors, and other data; one of them was changed, or they "
        "are of two vehicles (--vehicle); all count",
    )


def counted_elsewhere(store: Store, recording: RecordingRecord) -> Iterator[str]:
    """That another recording holds every frame of one; nothing where none does."""
    if recording.superseded_by is not None:
        yield f"{store.recording(recording.superseded_by).name} holds every frame of it, and is counted in its place"

"""What people are told of a recording: what of it was not audited, and by which thresholds; a sentence each."""

from collections.abc import Iterator

from auditor.model.calibration import Calibration
from auditor.model.rig_kind import Similarity
from auditor.model.settings import Criteria
from auditor.model.verdict import JudgedBy
from auditor.pipeline.judge import resolves_incidents
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.records import RecordingRecord, StoredJudgement
from auditor.store.store import Store


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


def as_a_part(judgement: StoredJudgement, calibration: Calibration) -> Iterator[str]:
    """What of the calibrated rig was not there: whoever removes a sensor's topic must not get a clean recording."""
    if judgement.absent_sensors:
        absent = ("the LiDAR" if sensor == "LiDAR" else sensor for sensor in judgement.absent_sensors)
        yield f"judged as a part of {calibration.rig_kind}: without {', '.join(absent)}"


def unresolved(judgement: StoredJudgement, calibration: Calibration, criteria: Criteria, by: JudgedBy) -> Iterator[str]:
    """What the clean frames were too few for."""
    if by is JudgedBy.BATCH:
        others = f"{len(calibration.recordings)} other recordings of its rig kind"
        yield f"judged by {others} that show nothing: provisional; calibrate on clean drives"
    if judgement.drives == 0:
        yield "judged by the prior alone: no clean drive of its rig kind was seen; calibrate on some"
    if not judgement.resolvable:
        yield f"r = {judgement.r} is not resolvable with the clean samples there are: judged as at r = 0"
    if not resolves_incidents(calibration, criteria):
        yield "too few clean frames for that incident rate: its limit is extrapolated"


def marked(judgement: StoredJudgement, calibration: Calibration) -> Iterator[str]:
    """The vehicle, LiDAR or machine that the calibration is of and the recording is not; or that it is of both."""
    marks = judgement.marks
    if marks.similarity is not Similarity.SAME:
        which = "a similar" if marks.similarity is Similarity.SIMILAR else "another"
        yield f"thresholds transferred from {which} rig kind: {calibration.rig_kind}"
    if marks.other_lidar:
        whose = "that of the thresholds" if calibration.clean else "those of the prior"
        yield f"another LiDAR than {whose}, by its points in view"
    if marks.in_sample:
        yield "in sample: the calibration was made of it"
    if marks.measured_otherwise:
        yield f"the calibration's counts may differ: {marks.measured_otherwise}"


_RIGS = """
    SELECT DISTINCT vehicle, recording_id, [entry.topic for entry in sensors] AS topics
    FROM measurements JOIN rigs USING (rig_id)
    WHERE vehicle IS NOT NULL
"""


class UsualRigs:
    """Tells where the rig of a recording is smaller than its vehicle's usual one: the largest of its other recordings.

    The store is read when a recording is asked for that was not there before.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._rigs: dict[str, list[frozenset[str]]] = {}
        self._largest: dict[str, dict[str, frozenset[str]]] = {}

    def missing(self, recording: RecordingRecord, topics: frozenset[str]) -> str:
        """A sentence on the topics that a rig of these topics lacks; empty where it lacks none, or that is not known.

        Of several rigs of a recording only the largest are compared, with all that any of them has.
        """
        recording_id, vehicle = recording.recording_id, recording.vehicle
        if vehicle is None:
            return ""
        if recording_id not in self._rigs:
            self._read()
        own = self._rigs.get(recording_id, [])
        by_recording = self._largest.get(vehicle, {})
        usual = next((rig for other, rig in by_recording.items() if other != recording_id), frozenset[str]())
        largest = max(map(len, own), default=0)
        lacking = sorted(usual - frozenset[str]().union(*own))
        if len(topics) < largest or len(usual) <= largest or not lacking:
            return ""
        return (
            f"its rig has {len(topics)} sensors, and the usual one of vehicle {vehicle} has {len(usual)}: "
            f"without {', '.join(lacking)}"
        )

    def _read(self) -> None:
        """Read the rigs of each recording, and by vehicle the largest of each recording, the largest of all first."""
        self._rigs, self._largest = {}, {}
        rows = rows_of(run_sql(self._store, _RIGS))
        for row in sorted(rows, key=lambda row: (len(row["topics"]), sorted(row["topics"])), reverse=True):
            topics = frozenset(row["topics"])
            self._rigs.setdefault(row["recording_id"], []).append(topics)
            self._largest.setdefault(row["vehicle"], {}).setdefault(row["recording_id"], topics)

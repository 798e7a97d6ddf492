"""The usual rig of a vehicle, by the other recordings that a store has of it."""

from dataclasses import dataclass

from auditor.store import RecordingRecord, Store, rows_of, run_sql

_RIGS = """
    SELECT DISTINCT vehicle, recording_id, [entry.topic for entry in sensors] AS topics
    FROM measurements JOIN rigs USING (rig_id)
    WHERE vehicle IS NOT NULL
"""


@dataclass(frozen=True)
class _Seen:
    vehicle: str
    recording_id: str
    topics: frozenset[str]


class UsualRigs:
    """Tells where the rig of a recording is smaller than its vehicle's usual one: the largest of its other recordings.

    The store is read when a recording is asked for that was not there before.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._seen: list[_Seen] = []

    def missing(self, recording: RecordingRecord, topics: frozenset[str]) -> str:
        """A sentence on the topics that a rig of these topics lacks; empty where it lacks none, or that is not known.

        Of several rigs of a recording only the largest are compared, with all that any of them has.
        """
        recording_id, vehicle = recording.recording_id, recording.vehicle
        if vehicle is None:
            return ""
        if not any(one.recording_id == recording_id for one in self._seen):
            rows = rows_of(run_sql(self._store, _RIGS))
            self._seen = [_Seen(row["vehicle"], row["recording_id"], frozenset(row["topics"])) for row in rows]
        own = [one.topics for one in self._seen if one.recording_id == recording_id]
        others = [one.topics for one in self._seen if one.vehicle == vehicle and one.recording_id != recording_id]
        usual = max(others, key=lambda other: (len(other), sorted(other)), default=frozenset[str]())
        largest = max(map(len, own), default=0)
        lacking = sorted(usual - frozenset[str]().union(*own))
        if len(topics) < largest or len(usual) <= largest or not lacking:
            return ""
        return (
            f"its rig has {len(topics)} sensors, and the usual one of vehicle {vehicle} has {len(usual)}: "
            f"without {', '.join(lacking)}"
        )

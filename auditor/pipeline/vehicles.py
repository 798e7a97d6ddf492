"""The usual rig of a vehicle, by the other recordings that a store has of it."""

from auditor.store import RecordingRecord, Store, rows_of, run_sql

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

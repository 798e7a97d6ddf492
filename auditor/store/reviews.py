"""Reviews: what somebody said of an incident. They are kept in files of their own, and none is ever changed.

A review is bound to what stays when an incident is measured or judged anew: recordings by their content, the drive, the
time and the sensors. The views `reviews` and `incidents` find it again.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, date, datetime
from enum import StrEnum
from typing import Any

from auditor.errors import StoreError
from auditor.store.export import rows_of
from auditor.store.log.entry import EntryKind, user
from auditor.store.log.runs import logged
from auditor.store.queries import run_query, run_sql
from auditor.store.records import content_id, to_utc
from auditor.store.store import Store


class ReviewVerdict(StrEnum):
    """What a reviewer says of an incident."""

    CONFIRMED = "confirmed"
    FALSE_ALARM = "false-alarm"
    KNOWN = "known"


_EXCUSING = frozenset({ReviewVerdict.FALSE_ALARM, ReviewVerdict.KNOWN})

_ID = re.compile(r"[0-9a-f]{1,32}")
_NAMED = "SELECT name, incident_id FROM incident_names WHERE {}"


@dataclass(frozen=True)
class Review:
    """One review. `until` is the last day on which it counts, None where it counts for good; times are UTC."""

    verdict: ReviewVerdict
    reason: str
    until: date | None
    author: str
    reviewed_at: datetime
    incident_id: str
    kind: str
    name: str
    recordings: tuple[str, ...]
    drive_id: str | None
    sensors: tuple[str, ...]
    from_ns: int
    to_ns: int

    @property
    def review_id(self) -> str:
        """The id that follows from everything in it."""
        values = asdict(self)
        return content_id("review", {name: str(value) for name, value in values.items()})


def incident_called(store: Store, incidents: Sequence[dict[str, Any]], beginning: str) -> dict[str, Any]:
    """The one of the rows of the view `incidents` whose id begins so, or began so before it grew.

    Raises StoreError unless it is just one.
    """
    rows = [row for row in incidents if row["incident_id"].startswith(beginning)]
    if not rows and _ID.fullmatch(beginning):
        ids = set(incidents_named(store, [beginning]).values())
        rows = [row for row in incidents if row["incident_id"] in ids]
    if len(rows) == 1 and beginning:
        return rows[0]
    problem = f"{len(rows)} incidents have an id that begins so" if rows else "the store has no such incident"
    raise StoreError(problem, where=beginning, remedy="auditor query incidents lists them with their ids")


def incidents_named(store: Store, beginnings: Iterable[str]) -> dict[str, str]:
    """The ids of the incidents that have, or may have had, a name that begins so, by these names. Raises StoreError."""
    wanted = " OR ".join(f"starts_with(name, '{one}')" for one in beginnings if _ID.fullmatch(one))
    return {row["name"]: row["incident_id"] for row in rows_of(run_sql(store, _NAMED.format(wanted or "false")))}


def excuse(incident: Mapping[str, Any]) -> str:
    """Say why an incident, a row of the view `incidents`, fails no audit; empty where it does fail one.

    It is the review in effect, where that calls it a false alarm or known: the view has none whose last day is over.
    """
    return in_words(incident) if incident["review"] in _EXCUSING else ""


def in_words(incident: Mapping[str, Any]) -> str:
    """What the review in effect says of an incident, a row of the view `incidents`, and whether it has grown since."""
    seconds, then = incident["seconds"], incident["reviewed_seconds"]
    grown = f" (it has grown since, from {then:.1f} to {seconds:.1f} s)" if seconds > then else ""
    return f"reviewed as {incident['review'].replace('-', ' ')}: {incident['review_reason']}{grown}"


def review_incident(
    store: Store, incident: Mapping[str, Any], verdict: ReviewVerdict, reason: str, until: date | None = None
) -> Review:
    """Keep what the user of this process says of an incident, a row of the view `incidents`. Raises StoreError."""
    recording = store.recording(incident["recording_id"])
    review = Review(
        verdict=verdict,
        reason=reason,
        until=until,
        author=user(),
        reviewed_at=datetime.now(UTC),
        incident_id=incident["incident_id"],
        kind=incident["kind"],
        name=incident["name"],
        recordings=tuple(part["recording_id"] for part in incident["parts"]),
        # Relative clocks of two recordings show the same stamps at different times.
        drive_id=incident["drive_id"] if recording.clock != "relative" else None,
        sensors=tuple(incident["attacked_names"]),
        from_ns=incident["from_ns"],
        to_ns=incident["to_ns"],
    )
    keep_review(store, review)
    return review


def keep_review(store: Store, review: Review) -> None:
    """Put a review beside the others; the log says who reviewed what. Raises StoreError."""
    with logged(store.folder) as entry:
        row = {**asdict(review), "review_id": review.review_id, "reviewed_at": to_utc(review.reviewed_at)}
        store.write("reviews", review.review_id, [row])
        entry.say(
            EntryKind.REVIEWED,
            {
                "review": review.review_id,
                "incident": review.incident_id,
                "verdict": review.verdict.value,
                "author": review.author,
                "until": str(review.until) if review.until else None,
            },
        )


def false_alarms(store: Store) -> frozenset[str]:
    """The measurements that have incidents, all of them reviewed as false alarms. Raises StoreError."""
    said: dict[str, set[str | None]] = {}
    if store.ids("reviews"):
        for row in rows_of(run_query(store, "incidents", {})):
            for part in row["parts"]:
                said.setdefault(part["measurement_id"], set()).add(row["review"])
    return frozenset(known for known, words in said.items() if words == {ReviewVerdict.FALSE_ALARM})

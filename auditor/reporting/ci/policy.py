"""Which incidents fail an audit: reviews, and a policy file with suppressions and a baseline, excuse some.

fail = ["attacked", "unidentified"]    # kinds of incidents that fail; without it all do
baseline = "release-12.json"           # a store, or its incidents as JSON: what it has does not fail

[[suppress]]
recording = "drive_0009.mcap"          # each of incident, recording, vehicle and sensors that is given must fit
sensors = ["S_2"]
reason = "low sun over the car park"
until = 2026-12-31                     # the last day on which it counts
"""

import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from pathlib import Path
from typing import Any

from auditor.errors import SettingError
from auditor.model.verdict import FINDINGS, VerdictKind
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.reviews import EXCUSING, in_words
from auditor.store.store import Store

Incident = Mapping[str, Any]
"""A row of the view `incidents`."""

_KEYS = ("fail", "baseline", "suppress")
_NEEDED = ("reason", "until")
_SUPPRESS_KEYS = ("incident", "recording", "vehicle", "sensors", *_NEEDED)
_COMPARED = ("attacked_names", "from_ns", "to_ns", "parts")
_REMEDY = "docs/output.md describes the file"


@dataclass(frozen=True)
class Suppression:
    """Incidents that do not fail until the end of a day. What is None fits all; `sensors` are all of an incident's."""

    reason: str
    until: date
    incident: str | None = None
    recording: str | None = None
    vehicle: str | None = None
    sensors: tuple[str, ...] | None = None

    def fits(self, incident: Incident) -> bool:
        """Whether an incident is one of those."""
        return (
            (self.incident is None or incident["incident_id"].startswith(self.incident))
            and (self.recording is None or any(_is_called(part, self.recording) for part in incident["parts"]))
            and (self.vehicle is None or incident["vehicle"] == self.vehicle)
            and (self.sensors is None or _are(incident["attacked_names"], self.sensors))
        )


@dataclass(frozen=True)
class Policy:
    """What fails. `baseline` has the incidents that were there before; None where there is nothing to compare with."""

    fail: frozenset[VerdictKind] = FINDINGS
    suppressions: tuple[Suppression, ...] = ()
    baseline: tuple[Incident, ...] | None = None


@dataclass(frozen=True)
class Decided:
    """An incident, and why it does not fail; `excuse` is empty where it fails. `new` is None without a baseline."""

    incident: Incident
    excuse: str
    new: bool | None

    @property
    def fails(self) -> bool:
        """Whether it fails the audit."""
        return not self.excuse


def read_policy(path: Path) -> Policy:
    """The policy of a file. Raises SettingError where it makes no sense, and StoreError for a baseline that is none."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SettingError(f"it is no policy that can be read ({error})", where=path, remedy=_REMEDY) from error
    _check_keys(content, _KEYS, path)
    words = _list_of_text(content.get("fail", [kind.value for kind in FINDINGS]), "fail", path)
    unknown = set(words) - {kind.value for kind in FINDINGS}
    if unknown:
        raise SettingError(f"fail has {', '.join(sorted(unknown))}", where=path, remedy=f"kinds are {_kinds()}")
    suppress = content.get("suppress", [])
    if not isinstance(suppress, list):
        raise SettingError("suppress is no list of tables", where=path, remedy="write [[suppress]] before each")
    baseline = content.get("baseline")
    return Policy(
        frozenset(VerdictKind(word) for word in words),
        tuple(_suppression(one, path) for one in suppress),
        None if baseline is None else tuple(_baseline(path.parent / _text(baseline, "baseline", path))),
    )


def decide(incidents: Iterable[Incident], policy: Policy, today: date) -> list[Decided]:
    """Which incidents fail by a policy on a day, and why the others do not."""
    decided = []
    for incident in incidents:
        new = None
        if policy.baseline is not None:
            new = not any(is_one_incident(incident, known) for known in policy.baseline)
        decided.append(Decided(incident, _excuse(incident, policy, today, new=new), new))
    return decided


def is_one_incident(one: Incident, other: Incident) -> bool:
    """Whether two findings are of one incident: a recording or drive in common, one time, and the same sensors.

    It is the rule of the macro of that name in SQL, by which reviews are found again.
    """
    return (
        bool(_places(one) & _places(other))
        and sorted(one["attacked_names"]) == sorted(other["attacked_names"])
        and one["from_ns"] <= other["to_ns"]
        and other["from_ns"] <= one["to_ns"]
    )


def _excuse(incident: Incident, policy: Policy, today: date, *, new: bool | None) -> str:
    if incident["review"] in EXCUSING:
        return in_words(incident)
    for one in policy.suppressions:
        if today <= one.until and one.fits(incident):
            return f"suppressed until {one.until}: {one.reason}"
    if new is False:
        return "it is in the baseline"
    if VerdictKind(incident["kind"]) not in policy.fail:
        return f"{incident['kind']} does not fail by the policy"
    return ""


def _places(incident: Incident) -> set[str]:
    drive = incident.get("drive_id") if incident.get("from_utc") else None  # relative clocks show the same stamps
    return {part["recording_id"] for part in incident["parts"]} | ({drive} if drive else set())


def _is_called(part: Mapping[str, Any], wanted: str) -> bool:
    return bool(part["name"] == wanted or part["recording_id"].startswith(wanted))


def _are(names: Sequence[str], wanted: Sequence[str]) -> bool:
    """Whether sensors are those wanted; each is 'S_2 name', and may be wanted as S_2."""
    return sorted(name.split(" ")[0] for name in names) == sorted(one.split(" ")[0] for one in wanted)


def _suppression(content: object, path: Path) -> Suppression:
    if not isinstance(content, dict):
        raise SettingError("suppress has what is no table", where=path, remedy="write [[suppress]] before each")
    _check_keys(content, _SUPPRESS_KEYS, path)
    for name in _NEEDED:
        if not content.get(name):
            raise SettingError(f"a suppression has no {name}", where=path, remedy="say why, and until which day")
    until = content["until"]
    if not isinstance(until, date) or isinstance(until, datetime):
        raise SettingError(f"until is {until!r}, not a day", where=path, remedy="write until = 2026-12-31")
    texts = {name: _text(content[name], name, path) for name in _SUPPRESS_KEYS[:3] if name in content}
    sensors = _list_of_text(content["sensors"], "sensors", path) if "sensors" in content else None
    if not texts and sensors is None:
        raise SettingError(
            "a suppression fits every incident", where=path, remedy="name an incident, recording, vehicle or sensors"
        )
    return Suppression(_text(content["reason"], "reason", path), until, sensors=sensors, **texts)


def _baseline(path: Path) -> Iterable[Incident]:
    if not path.is_file():
        yield from rows_of(run_query(Store.open(path), "incidents", {}))
        return
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        rows = content["incidents"] if isinstance(content, dict) else content
        for row in rows:
            yield {name: row[name] for name in _COMPARED} | {name: row.get(name) for name in ("drive_id", "from_utc")}
    except (OSError, ValueError, TypeError, KeyError) as error:
        remedy = "auditor scan --format json and auditor query incidents --format json write one"
        raise SettingError(f"it is no baseline that can be read ({error})", where=path, remedy=remedy) from error


def _check_keys(content: Mapping[str, object], known: Sequence[str], path: Path) -> None:
    unknown = [name for name in content if name not in known]
    if unknown:
        raise SettingError(f"it has {unknown[0]!r}", where=path, remedy=f"what it may have is {', '.join(known)}")


def _text(value: object, name: str, path: Path) -> str:
    if not isinstance(value, str) or not value:
        raise SettingError(f"{name} is {value!r}, not a text", where=path, remedy=_REMEDY)
    return value


def _list_of_text(value: object, name: str, path: Path) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
        raise SettingError(f"{name} is {value!r}, not a list of texts", where=path, remedy=_REMEDY)
    return tuple(value)


def _kinds() -> str:
    return ", ".join(sorted(kind.value for kind in FINDINGS))

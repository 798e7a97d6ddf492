"""An audit as SARIF 2.1.0: one result an incident, one notification for each recording that was not audited."""

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import auditor
from auditor.model.text import one_line
from auditor.reporting.ci.audit import Audit, sentence
from auditor.reporting.ci.policy import Decided

_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
_RULES = {
    "attacked": (
        "error",
        "A sensor was attacked",
        "Light or points disagree with every other sensor's, and it is named.",
    ),
    "unidentified": ("warning", "An attack without a named sensor", "Sensors disagree, and which one cannot be told."),
    "suspect": ("note", "A suspected attack", "Another cause than an attack explains the disagreement as well."),
}
"""By the kind of an incident: its level, and what it means."""


def sarif(audit: Audit) -> str:
    """An audit as the text of a SARIF file."""
    run = {
        "tool": {"driver": _driver()},
        "columnKind": "utf16CodeUnits",
        "invocations": [
            {
                "executionSuccessful": audit.exit_code < 2,
                "exitCode": audit.exit_code,
                "toolExecutionNotifications": [
                    {
                        "level": "warning",
                        "message": {"text": one_line(f"{left.name}: {left.reason}")},
                        "locations": [_location(left.path)],
                    }
                    for left in audit.left
                ],
            }
        ],
        "results": [_result(audit, one) for one in audit.decided],
    }
    return json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1) + "\n"


def _driver() -> dict[str, Any]:
    return {
        "name": "auditor",
        "version": auditor.__version__,
        "rules": [
            {
                "id": kind,
                "shortDescription": {"text": title},
                "fullDescription": {"text": what},
                "defaultConfiguration": {"level": level},
            }
            for kind, (level, title, what) in _RULES.items()
        ],
    }


def _result(audit: Audit, one: Decided) -> dict[str, Any]:
    row = one.incident
    where = _location(audit.paths.get(row["recording_id"], row["name"]))
    where["logicalLocations"] = [{"name": one_line(name), "kind": "sensor"} for name in row["attacked_names"]]
    result = {
        "ruleId": row["kind"],
        "ruleIndex": list(_RULES).index(row["kind"]),
        "level": _RULES[row["kind"]][0],
        "message": {"text": sentence(one)},
        "locations": [where],
        "fingerprints": {"incident/v1": row["incident_id"]},
        # what stays of it when it is judged anew
        "partialFingerprints": {
            "finding/v1": f"{row['recording_id']}:{row['from_ns']}:{'+'.join(map(str, row['attacked']))}"
        },
        "properties": {
            name: row[name]
            for name in (
                "recording_id",
                "vehicle",
                "from_ns",
                "to_ns",
                "frames",
                "largest_gap",
                "alternatives",
                "causes",
            )
        },
    }
    if not one.fails:
        result["suppressions"] = [{"kind": "external", "status": "accepted", "justification": one_line(one.excuse)}]
    if one.new is not None:
        result["baselineState"] = "new" if one.new else "unchanged"
    return result


def _location(path: str) -> dict[str, Any]:
    """Where a recording lies, from the current folder on where it is in it."""
    place = Path(path)
    if place.is_absolute() and place.is_relative_to(Path.cwd()):
        place = place.relative_to(Path.cwd())
    uri = place.as_uri() if place.is_absolute() else quote(place.as_posix(), errors="backslashreplace")
    return {"physicalLocation": {"artifactLocation": {"uri": uri}}}

"""Ground truth inside a recording: attack labels as JSON."""

import json
from collections.abc import Iterable
from typing import Any

from auditor.errors import RecordingError
from auditor.results import AttackLabel

LABELS_NAME = "auditor-labels.json"
LABELS_MEDIA_TYPE = "application/json"
METADATA_NAME = "auditor"
MAX_JSON_BYTES = 16 * 2**20
MAX_JSON_PARTS = 1_000_000
"""A parsed list or object takes many times its text: they are counted first."""

METADATA_TOPIC = "/auditor/metadata"
"""Where .bag and .db3 recordings carry both, as JSON in a std_msgs/String: they have no attachments."""


def labels_to_json(labels: Iterable[AttackLabel]) -> bytes:
    """A JSON array with one object a label."""
    return json.dumps([label_to_dict(label) for label in labels], indent=1, sort_keys=True).encode()


def label_to_dict(label: AttackLabel) -> dict[str, Any]:
    """A plain description that `label_from_dict` reads back."""
    return {
        "topic": label.topic,
        "attack": label.attack,
        "from_ns": label.from_ns,
        "to_ns": label.to_ns,
        "parameters": dict(label.parameters),
    }


def label_from_dict(description: dict[str, Any]) -> AttackLabel:
    """Read what `label_to_dict` wrote. Raises KeyError, TypeError or ValueError where it is something else."""
    return AttackLabel(
        topic=str(description["topic"]),
        attack=str(description["attack"]),
        from_ns=int(description["from_ns"]),
        to_ns=int(description["to_ns"]),
        parameters=dict(description["parameters"]),
    )


def load_json(text: bytes | str) -> Any:  # noqa: ANN401  # what json.loads gives
    """Parse what may be hostile. Raises ValueError and RecursionError."""
    text = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    if len(text) > MAX_JSON_BYTES or sum(text.count(sign) for sign in (b",", b"[", b"{")) > MAX_JSON_PARTS:
        raise ValueError("it is too large")
    return json.loads(text)


def labels_from_json(text: bytes | str, where: object) -> tuple[AttackLabel, ...]:
    """Read what `labels_to_json` wrote. Raises RecordingError where it is something else."""
    try:
        return tuple(label_from_dict(description) for description in load_json(text))
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise RecordingError(f"its ground truth ({LABELS_NAME}) is ill-formed ({error})", where=where) from error

"""JSON of one form: equal values have equal texts, which ids and digests are made of."""

import json


def canonical_json(value: object) -> str:
    """A value as JSON with sorted keys and no spaces."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))

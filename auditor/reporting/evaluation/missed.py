"""What was missed: a few attacks that the robust method took for clean frames, with their pictures."""

import base64
import json
from collections.abc import Iterator, Mapping
from typing import Any

from auditor.reporting.evaluation.page import MissedAttack
from auditor.reporting.evaluation.tables import described
from auditor.store.evaluation_tables import case_key, missed_pictures
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.store import Store

NOT_KEPT = "none was kept, evaluate its recording again"
_SIZES = {"facula": ("radius_px", "R = {:.0f} px"), "bogus wall": ("width_m", "{:g} m wide")}
"""By kind of the paper's attacks: the parameter that is its size, and how it is written."""


def missed_attacks(store: Store) -> Iterator[MissedAttack]:
    """The attacks that `evaluation_missed` chooses. Raises StoreError."""
    kept = missed_pictures(store)
    for row in rows_of(run_query(store, "evaluation_missed", {})):
        picture = kept.get(case_key(row))
        (sensor,) = row["attacked"]
        yield MissedAttack(
            attack=_in_words(row, sensor),
            sensor=f"S_{sensor} ({store.rig(row['rig_id']).name(sensor)})",
            kind=row["kind"],
            recording=row["name"],
            frame=row["frame"],
            largest_z=row["largest_z"],
            limit_z=row["limit_z"],
            image=_data_uri(picture.jpeg) if picture and picture.jpeg else None,
            reason=NOT_KEPT if picture is None else picture.reason or "",
        )


def _data_uri(jpeg: bytes) -> str:
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"


def _in_words(row: Mapping[str, Any], sensor: int) -> str:
    """An attack with its strength and size, beginning with a capital."""
    known = json.loads(row["parameters"]).get(f"S_{sensor}", {})
    name, written = _SIZES.get(row["attack"], ("", ""))
    words = described({**row, "variant": row["strength"], "size": None if name else row["size"]})
    if name:
        strength = row["strength"] if row["attack"] == "facula" else None
        size = written.format(known[name]) if name in known else None
        words = ", ".join(filter(None, (" ".join(filter(None, (strength, words))), size)))
    return words[:1].upper() + words[1:]

"""The cases of a store's evaluations as arrays, one setup at a time: those that were made alike, of one rig kind."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.measurement import BRIGHTNESS, CASE_BRIGHTNESS, COUNTING_VERSIONS, NO_FINGERPRINT, Procedure
from auditor.model.rig import Rig
from auditor.model.rig_kind import ComparedTo
from auditor.store.evaluation_tables import CHUNK_FRAMES
from auditor.store.measurement_tables import floats, list_values, where_kept
from auditor.store.queries import run_sql
from auditor.store.store import Store

_KNOWN_BY = (
    "evaluation_id, recording_id, rig_id, experiment, frame, stamp_ns, draw, attacked, attack, strength, size, family"
)
_BRIGHTNESS = [name if name in CASE_BRIGHTNESS else f"NULL::DOUBLE[] AS {name}" for name in BRIGHTNESS]
_MEASURED = ", ".join(
    ("statistics", "present", "fingerprint", *_BRIGHTNESS, "fault_features", "fault_features_after", "returns")
)
_COUNTED = COUNTING_VERSIONS[ComparedTo.CAMERAS]  # a lone camera is not evaluated
_EARLIER = f"SELECT evaluation_id FROM evaluations WHERE counting_version < {_COUNTED}"  # noqa: S608 - a number
_CASES = f"""
SELECT setup, {_KNOWN_BY}, {_MEASURED}, made.matcher, made.settings, made.counting_version
FROM cases JOIN (SELECT evaluation_id, matcher, settings, counting_version FROM evaluations) AS made
USING (evaluation_id)
WHERE statistics IS NOT NULL AND evaluation_id NOT IN ({_EARLIER})
ORDER BY setup, rig_id, evaluation_id, frame, draw
"""  # noqa: S608 - our own names
_TOO_OLD = f"""
SELECT evaluation_id FROM cases WHERE statistics IS NULL UNION {_EARLIER} ORDER BY evaluation_id
"""  # noqa: S608 - our own names

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CaseIdentity:
    """What a case is known by. `family` is what its recording is alike with, or the recording's id."""

    evaluation_id: str
    recording_id: str
    rig_id: str
    experiment: str
    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    attack: str | None
    strength: str | None
    size: float | None
    family: str

    @property
    def block(self) -> tuple[str, int]:
        """Its recording and the block of time in it."""
        return self.recording_id, self.frame // CHUNK_FRAMES

    @property
    def drive(self) -> tuple[str, str]:
        """The frames that follow each other: its recording, by its rig."""
        return self.recording_id, self.rig_id


@dataclass(frozen=True, eq=False)
class Cases:
    """N cases of rigs of one kind, of which `rig` is one, by one procedure; NaN where something was not measured.

    `statistics` are (N, M) by sensor check; by sensor (N, S): `present`, `fingerprints`, and `brightness` by the names
    of BRIGHTNESS; `features` and `features_after` are (N, P, columns) fault features of the matched pairs, of their
    frame and of the clean one after it; `returns` (N,) are LiDAR points in view.
    """

    rig: Rig
    procedure: Procedure
    known: tuple[CaseIdentity, ...]
    statistics: Floats
    present: NDArray[np.bool_]
    fingerprints: NDArray[np.int64]
    brightness: Mapping[str, Floats]
    features: Floats
    features_after: Floats
    returns: Floats

    @cached_property
    def clean(self) -> NDArray[np.bool_]:
        """(N,) whether nothing was attacked."""
        return np.array([one.experiment == "clean" for one in self.known], dtype=np.bool_)


def load_cases(store: Store) -> Iterator[Cases]:
    """The cases of every setup that can be judged. Raises StoreError."""
    table = run_sql(store, _CASES)
    if not len(table):
        return
    groups: dict[tuple[object, ...], list[int]] = {}
    rigs = {rig_id: store.rig(rig_id) for rig_id in table["rig_id"].unique().to_pylist()}
    for row, (setup, rig_id) in enumerate(zip(table["setup"].to_pylist(), table["rig_id"].to_pylist(), strict=True)):
        groups.setdefault((setup, rig_sensor_checks(rigs[rig_id])), []).append(row)
    for rows in groups.values():
        part = table.take(rows)
        yield _cases(part, rigs[part["rig_id"][0].as_py()], store.folder)


def too_old(store: Store) -> list[str]:
    """The parts that earlier versions finished, which did not keep all that judging takes. Raises StoreError."""
    return [row["evaluation_id"] for row in run_sql(store, _TOO_OLD).to_pylist()]


def _cases(table: pa.Table, rig: Rig, path: Path) -> Cases:
    N, M, S, pairs = len(table), len(rig_sensor_checks(rig)), len(rig.sensors), len(rig.pairs)
    identities = table.select(_KNOWN_BY.split(", ")).to_pylist()
    present, fingerprints = (list_values(table[name], N * S, path) for name in ("present", "fingerprint"))
    features, after = (
        floats(table[name], N * pairs * len(COLUMNS), path).reshape(N, pairs, len(COLUMNS))
        for name in ("fault_features", "fault_features_after")
    )
    return Cases(
        rig,
        Procedure(*(table[name][0].as_py() for name in ("matcher", "settings", "counting_version"))),
        tuple(CaseIdentity(**{**one, "attacked": tuple(one["attacked"])}) for one in identities),
        floats(table["statistics"], N * M, path).reshape(N, M),
        np.asarray(present.to_numpy(zero_copy_only=False), dtype=np.bool_).reshape(N, S),
        np.asarray(fingerprints.fill_null(NO_FINGERPRINT).to_numpy(zero_copy_only=False)).reshape(N, S),
        {name: where_kept(table[name], S, path) for name in BRIGHTNESS},
        features,
        after,
        np.asarray(table["returns"].cast("float64").to_numpy(), dtype=np.float64),
    )

"""The answers of the evaluation queries for one setup, by what tells them apart."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations
from typing import Any

from auditor.model.rig import LIDAR, Rig, Triple
from auditor.reporting.evaluation.page import LEFT_OUT, STRENGTHS, Rate

Rows = list[dict[str, Any]]
Sensors = tuple[int, ...]

R_SHOWN = 0.01
"""The r of tables that show one only, as the paper's sensitivity study does."""

CURVE_RATES = ("0", "0.01", "0.02", "0.03", "0.05", *(f"{percent / 100:g}" for percent in range(10, 101, 10)))

ROLES = {
    "lidar": "Wall on the LiDAR",
    "reference": "Facula on the reference camera",
    "source": "Facula on the source camera",
}
SHORT_ROLES = {"lidar": "LiDAR", "reference": "reference camera", "source": "source camera"}


class Answers:
    """Rates by what is left out, system or triple, strength, attacked sensors (None or their number: average) and r."""

    def __init__(self, rig: Rig, rows: Mapping[str, Rows]) -> None:
        self.rig = rig
        self.rows = rows
        self.detection = {
            (
                row["left_out"],
                Triple(row["i"], row["j"], row["k"]),
                row["strength"],
                _set(row["attacked"]),
                row["r"],
            ): rate_of(row, "detected")
            for row in rows["detection"]
        }
        self.identification = {
            (
                row["left_out"],
                len(row["system"]),
                row["strength"],
                _set(row["attacked"]) or row["attacked_sensors"],
                row["r"],
            ): rate_of(row, "named")
            for row in rows["identification"]
        }
        n = rig.n
        self.modes = [mode for mode in LEFT_OUT if any(row["left_out"] == mode for row in rows["false_alarms"])]
        scenarios = {1: Triple(LIDAR, 1, n), 2: Triple(1, 2, n)} if self.modes else {}  # else no frame was measured
        self.scenarios = {number: triple for number, triple in scenarios.items() if triple in rig.triples}
        self.strengths = [s for s in STRENGTHS if any(key[2] == s for key in self.detection)]
        self.systems = sorted({tuple(row["system"]) for row in rows["identification"]}, key=len)


def names(sensors: Iterable[int]) -> str:
    """Sensors as words: S_0, S_1."""
    return ", ".join(f"S_{sensor}" for sensor in sensors)


def subsets(triple: Triple) -> Iterator[Sensors]:
    """The paper's seven combinations."""
    for size in (1, 2, 3):
        yield from combinations(triple, size)


def percent(r: str) -> str:
    """A rate as the tables write it."""
    return f"{float(r) * 100:g} %"


def size_of(row: Mapping[str, Any]) -> str:
    """The size of a sensitivity experiment's attack in words."""
    if row["visible_share"] is None:
        return f"{row['size']:g} m wide"
    return f"R = {row['size']:g} px ({row['nominal_share']:.2%} nominal, {row['visible_share']:.2%} visible)"


def _set(sensors: list[int] | None) -> Sensors | None:
    return None if sensors is None else tuple(sensors)


def rate_of(row: Mapping[str, Any], counted: str) -> Rate:
    """The rate of the column `counted`."""
    n = row["cases"] if "cases" in row else row["frames"]
    return Rate(row[counted], n, row["low"], row["high"], row["resolvable"])

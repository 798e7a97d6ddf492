r"""Drift in the synthetic fleet of `fleet_bank`: who is named on its evenings, rightly or not, and when.

Every vehicle drives every night. A night has 15 frames of each of three scenes, drawn by the season. One vehicle of
each rig kind comes back from a workshop with other values after night 45; one camera turns by 0.02 degrees a night from
night 60 on. What it changes was measured on streets (`turned_streets`). Each scene is of a vehicle of its own: its
usual row offset, bias and brightness of each pair, which are its vehicle's, are taken from its frames.

    python -m tests.benchmarks.fleet_drift --bank BANK --attacked ATTACKED --turned TURNED [--fleets 20] \
        [--turning 5]

Prints on how many evenings somebody is named who does not drift, with the smallest chance of each; after how many
nights the camera that turns is named; and from when on its logs are raised by thresholds of the fleet's clean logs at
r = 1 %. BANK, ATTACKED and TURNED are those of `fleet_nights`.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.drift import DailyLevels, Drift, SeriesName, drifts
from auditor.identification.prior import log_odds
from auditor.identification.refresh_parameters import DRIFT, LEAST_DEVIATIONS
from auditor.identification.refreshing.drives import shown_by
from auditor.model.arrays import Floats
from auditor.model.fault_features import COLUMNS
from auditor.model.rig import LIDAR
from tests.benchmarks.fleet_bank import (
    CHANGED,
    FRAMES,
    NIGHTS,
    OF_DRIVE,
    TURNING,
    TURNS,
    VEHICLES,
    WORKSHOP,
    Bank,
    Fleet,
    Turn,
    bank_of,
    wilson_percent,
)
from tests.benchmarks.scenes import Case, Scene
from tests.benchmarks.turned_frames import TURNED

PLACES, OF_A_PLACE = 3, 15
EVENINGS = (29, 59)
"""Before the camera turns; of the last, the vehicle that was in the workshop is no false alarm."""
LONGEST = 10
"""Nights that the camera turns for, at most."""

Key = tuple[str, tuple[int, ...], bool]


def levels_of(case: Case, scene: Scene, turn: Turn | None) -> dict[Key, float]:
    """What the view daily_levels takes of one frame, by check, sensors and whether it is signed; without statistics."""
    found: dict[Key, float] = {}
    for pair, values in case.features.items():
        known = dict(zip(COLUMNS, np.add(values, turn.features.get(pair, 0.0) if turn else 0.0), strict=True))
        found["row_offset", pair, True] = known["offset_px"]
        found["depth_bias", pair, True] = known["bias_px"]
        found["row_misalignment", pair, False] = _odds(1 - known["row_aligned"])
        found["lidar_disagreement", (LIDAR, *pair), False] = _odds(1 - known["agreeing"])
        levels = [max(case.level.get(camera) or 0.0, 1.0) for camera in pair]
        found["brightness", pair, True] = float(np.log(levels[0] / levels[1]))
    for triple, error in zip(scene.rig.measured_triples, case.errors, strict=True):
        found["disparity_error", triple[:3], False] = _odds(error)
    found["returns", (LIDAR,), False] = float(np.log(max(case.returns or 0, 1)))
    return found


def _odds(share: float) -> float:
    return float(log_odds(np.clip(np.asarray(share), 0, 1)))


_MIDDLES = np.nanmean, np.nanmedian

Tables = dict[tuple[int, int], tuple[list[Key], Floats]]
"""The levels of the frames of a scene, (F, K), by scene and number of sensors."""


class Days:
    """The levels of the vehicles of one rig kind, night by night."""

    def __init__(self, bank: Bank, fleet: Fleet, tables: Tables) -> None:
        self._bank, self._fleet = bank, fleet
        checks = fleet.system.sensor_checks
        most = {one[:2]: max(len(o.others) for o in checks if o[:2] == one[:2]) for one in checks}
        self._checks = [one for one in checks if len(one.others) == most[one[:2]]]
        self._of_checks: list[Key] = [(one.check.value, (one.sensor,), False) for one in self._checks]
        self._tables = tables
        self._usual: dict[int, list[dict[Key, float]]] = {}

    def night(self, vehicle: int, night: int, rng: np.random.Generator) -> dict[Key, float]:
        """The levels of a vehicle's night; NaN where a check was not measured."""
        drawn, own, drive = [], self._fleet.own(vehicle, night), self._fleet.drawn(rng, OF_DRIVE)
        turn = self._fleet.turned(vehicle, night, rng)
        for scene in rng.choice(len(self._bank.clean), PLACES, p=self._fleet.weights(night)):
            keys, table = self._table(int(scene), turn)
            drawn.append(table[rng.integers(0, len(table), OF_A_PLACE)])
        values = np.concatenate(drawn)
        enough = np.count_nonzero(~np.isnan(values), axis=0) >= DRIFT.fewest_frames
        values = np.where(enough, values, 0.0)
        middle = np.where([key[0] == "depth_bias" for key in keys], *(of(values, axis=0) for of in _MIDDLES))
        middle[~enough] = np.nan
        shift = [own[one] + drive[one] + (turn.odds.get(one, 0.0) if turn else 0.0) for one in self._checks]
        middle[: len(shift)] += shift
        return {key: float(level) for key, level in zip(keys, middle, strict=True) if np.isfinite(level)}

    def _unturned(self, place: int) -> list[dict[Key, float]]:
        """The levels of the frames of a scene."""
        if place not in self._usual:
            scene = self._bank.clean[place]
            self._usual[place] = [levels_of(case, scene, None) for case in scene.cases]
        return self._usual[place]

    def _table(self, place: int, turn: Turn | None) -> tuple[list[Key], Floats]:
        """The levels of a scene, (F, K); those of checks first."""
        known = place, len(self._fleet.system.sensors)
        if turn or known not in self._tables:
            scene, clean = self._bank.clean[place], self._fleet.frames[place]
            there = set(self._fleet.system.sensors)
            rows = [levels_of(case, scene, turn) for case in scene.cases] if turn else self._unturned(place)
            keys = [key for key in rows[0] if set(key[1]) <= there]
            table = np.array([[row.get(key, np.nan) for key in keys] for row in rows])
            usual = np.array([[row.get(key, np.nan) for key in keys] for row in self._unturned(place)])
            table -= np.where([signed for _, _, signed in keys], np.median(usual, axis=0), 0.0)
            of_checks = log_odds(clean.statistics_of(self._checks))
            if turn:  # another one every night
                return [*self._of_checks, *keys], np.hstack([of_checks, table])
            self._tables[known] = [*self._of_checks, *keys], np.hstack([of_checks, table])
        return self._tables[known]


Series = dict[SeriesName, tuple[bool, list[tuple[int, float]]]]
"""By series whether it is signed, and its nights and levels."""


def nights(bank: Bank, seed: int, last: int, tables: Tables) -> Series:
    """The levels of a fleet of both rig kinds, by series."""
    found: Series = {}
    for cameras in VEHICLES:
        fleet = Fleet(bank, cameras, NIGHTS, seed)
        days = Days(bank, fleet, tables)
        for vehicle in range(fleet.vehicles):
            for night in range(last + 1):
                rng = np.random.default_rng((seed, cameras, vehicle, night, 7))
                for (check, sensors, signed), level in days.night(vehicle, night, rng).items():
                    name = SeriesName(f"{cameras} cameras", check, sensors, f"car{vehicle}")
                    found.setdefault(name, (signed, []))[1].append((night, level))
    return found


def named(series: Series, evening: int) -> Iterator[Drift]:
    """What is named on an evening, by the last days."""
    levels = []
    for name, (signed, rows) in series.items():
        of_window = [row for row in rows if evening - DRIFT.days < row[0] <= evening]
        if of_window:
            levels.append(DailyLevels(name, signed, *map(np.array, zip(*of_window, strict=True))))
    return (one for one in drifts(levels, LEAST_DEVIATIONS.of) if one.named)


def is_false(one: Drift, evening: int) -> bool:
    """Whether nothing happened to a vehicle that is named."""
    was_there = one.name.vehicle == f"car{CHANGED}" and evening >= WORKSHOP
    turns = (one.name.kind, one.name.vehicle) == (f"{min(VEHICLES)} cameras", f"car{TURNING}") and evening >= TURNS
    return not (was_there or turns)


def raised_from(bank: Bank, seed: int) -> int | None:
    """After how many nights of turning a stretch of its frames does not seem clean to thresholds of clean logs."""
    fleet = Fleet(bank, min(VEHICLES), NIGHTS, seed)
    clean = [made.log.frames() for night in range(30, TURNS) for made in fleet.night(night, None)][:FRAMES]
    thresholds = thresholds_of(clean, fleet.system, Decimal("0.01"))
    for turning in range(1, 31):
        rng = np.random.default_rng((seed, turning))
        shown = shown_by(fleet.log(TURNS + turning - 1, 0, TURNING, rng).frames(), fleet.system, thresholds)
        if shown.raised(Decimal("0.01")):
            return turning
    return None


def _percent(k: int, n: int) -> str:
    low, high = wilson_percent(k, n)
    return f"{k} of {n} ({100 * k / n:.1f} %, {low:.1f} to {high:.1f})"


def _told(values: Sequence[int | None]) -> str:
    known = sorted(one for one in values if one is not None)
    return (
        f"median {known[len(known) // 2]}, {known[0]} to {known[-1]}, {len(known)} of {len(values)}" if known else "-"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bank", type=Path, required=True)
    parser.add_argument("--attacked", type=Path, required=True)
    parser.add_argument("--turned", type=Path, required=True)
    parser.add_argument("--fleets", type=int, default=20)
    parser.add_argument("--turning", type=int, default=5, help="fleets in which turning is looked at as well")
    options = parser.parse_args()
    bank = bank_of(options.bank, options.attacked, options.turned)
    by, chances, workshop = Counter[str](), list[float](), list[Drift]()
    after, raised = list[int | None](), list[int | None]()
    tables: Tables = {}
    for seed in range(options.fleets):
        series = nights(bank, seed, TURNS + LONGEST if seed < options.turning else max(EVENINGS), tables)
        for evening in EVENINGS:
            false = [one for one in named(series, evening) if is_false(one, evening)]
            chances += [min(min([one.chance, *(o.chance for o in one.changes)]) for one in false)] if false else []
            by.update(one.name.check for one in false)
        print(f"{seed}: false {len(chances)} {dict(by)}", flush=True)
        if seed >= options.turning:
            continue
        workshop += [one for one in named(series, max(EVENINGS)) if one.name.vehicle == f"car{CHANGED}"][:1]
        after.append(next((k for k in range(1, LONGEST + 1) if any(map(_turns, named(series, TURNS + k - 1)))), None))
        raised.append(raised_from(bank, seed))
        print(f"  named after {after[-1]} nights of turning, logs raised after {raised[-1]}", flush=True)
    evenings = len(EVENINGS) * options.fleets
    print(f"evenings on which another vehicle is named: {_percent(len(chances), evenings)}, {dict(by)}")
    print(f"smallest chances of these: {', '.join(f'{one:.1g}' for one in sorted(chances))}")
    print(f"nights after which the camera that turns is named: {_told(after)}; its logs are raised: {_told(raised)}")
    print(f"fleets in which the visit to the workshop is named: {len(workshop)} of {options.turning}")


def _turns(one: Drift) -> bool:
    where = one.name.kind, one.name.vehicle, one.name.sensors
    return where == (f"{min(VEHICLES)} cameras", f"car{TURNING}", (TURNED,))


if __name__ == "__main__":
    main()

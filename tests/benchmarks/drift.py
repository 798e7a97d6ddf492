"""Drift of a fleet whose nights are drawn from measured frames of the real drives: who is named, and when.

`python -m tests.benchmarks.drift FOLDER [FLEETS]`: measures the frames into FOLDER where it has none (see
`turned_frames`), and draws fleets of 20 vehicles and 40 nights. A night of a vehicle has 24 frames of four places. One
camera of one vehicle turns by 0.02 degrees a night for the last nights. The frames are of one vehicle and one day of
recording: its vehicles differ by the places that are drawn, not by their build, weather or season.
"""

import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from auditor.identification.drift import DailyLevels, Drift, SeriesName, drifts
from auditor.identification.prior import log_odds
from auditor.identification.refresh_parameters import LEAST_DEVIATIONS
from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.rig import Rig
from tests.benchmarks.turned_frames import AXES, DRIVES, STEPS, TURNED, TurnedFrame, kept_frames

VEHICLES, NIGHTS, FRAMES, PLACES = 20, 40, 24, 4
LONGEST = 6
"""Nights that a camera turns for."""

Key = tuple[str, tuple[int, ...], bool]


def levels_of(frame: TurnedFrame, rig: Rig) -> dict[Key, float]:
    """What the view daily_levels takes of one frame, by check, sensors and whether it is signed."""
    found: dict[Key, float] = {}
    checks = rig_sensor_checks(rig)
    for check, statistic in zip(checks, frame.statistics, strict=True):
        if len(check.others) == max(len(one.others) for one in checks if one[:2] == check[:2]):
            found[check.check.value, (check.sensor,), False] = float(log_odds(np.float64(statistic)))
    for pair, features in frame.measurement.fault_features.items():
        known = dict(zip(COLUMNS, features.values, strict=True))
        found["row_offset", pair, True] = known["offset_px"]
        found["depth_bias", pair, True] = known["bias_px"]
        found["row_misalignment", pair, False] = float(log_odds(np.float64(1 - known["row_aligned"])))
        found["lidar_disagreement", (0, *pair), False] = float(log_odds(np.float64(1 - known["agreeing"])))
    for triple, counts in zip(rig.measured_triples, frame.measurement.counts, strict=True):
        if counts is not None and counts.gated_valid_px:
            share = counts.gated_inconsistent_px / counts.gated_valid_px
            found["disparity_error", triple[:3], False] = float(log_odds(np.float64(share)))
    return {key: value for key, value in found.items() if np.isfinite(value)}


class Bank:
    """The levels of measured frames, by axis, step and place."""

    def __init__(self, folder: Path) -> None:
        self.by: dict[tuple[str, int], dict[str, list[dict[Key, float]]]] = defaultdict(lambda: defaultdict(list))
        for number in DRIVES:
            rig, frames = kept_frames(folder, number)
            for frame in frames:
                for axis in AXES if frame.step == 0 else (frame.axis,):
                    self.by[axis, frame.step][frame.place].append(levels_of(frame, rig))

    def night(self, rng: np.random.Generator, axis: str, step: int) -> dict[Key, float]:
        """The levels of a night: its median, of depth_bias its mean."""
        places = self.by[axis, step]
        chosen = [one for place in rng.choice(sorted(places), PLACES, replace=False) for one in places[place]]
        drawn = [chosen[n] for n in rng.integers(0, len(chosen), FRAMES)]
        keys = {key for one in drawn for key in one}
        middle: dict[bool, Callable[..., np.floating]] = {True: np.mean, False: np.median}
        return {k: float(middle[k[0] == "depth_bias"]([o[k] for o in drawn if k in o])) for k in keys}


def fleet(bank: Bank, rng: np.random.Generator, axis: str, turning: int) -> list[DailyLevels]:
    """The levels of a fleet; the camera of the first vehicle turns for the last nights."""
    found: dict[tuple[str, Key], list[tuple[int, float]]] = defaultdict(list)
    for vehicle in range(VEHICLES):
        for night in range(NIGHTS):
            step = max(night - (NIGHTS - 1 - turning), 0) if vehicle == 0 else 0
            for key, level in bank.night(rng, axis, min(step, STEPS)).items():
                found[f"car{vehicle}", key].append((night, level))
    return [
        DailyLevels(SeriesName("kind", check, sensors, vehicle), signed, *map(np.array, zip(*rows, strict=True)))
        for (vehicle, (check, sensors, signed)), rows in found.items()
    ]


def named(comparisons: Sequence[DailyLevels]) -> Iterator[Drift]:
    """What is named of a fleet."""
    return (one for one in drifts(comparisons, LEAST_DEVIATIONS.of) if one.named)


def main() -> None:
    """Print who is named after how many nights, and how often somebody else is."""
    bank, fleets = Bank(Path(sys.argv[1])), int(sys.argv[2]) if len(sys.argv) > 2 else 20
    alarms = evenings = 0
    for axis in AXES:
        for turning in range(LONGEST + 1):
            found, beside, others, by = 0, 0, 0, Counter[str]()
            for seed in range(fleets):
                rng = np.random.default_rng([seed, turning, list(AXES).index(axis)])
                some = [one.name for one in named(fleet(bank, rng, axis, turning))]
                mine = {name.check for name in some if (name.vehicle, name.sensors) == ("car0", (TURNED,))}
                found, by = found + bool(mine), by + Counter(mine)
                beside += any(name.vehicle == "car0" and name.sensors != (TURNED,) for name in some)
                others += any(name.vehicle != "car0" for name in some)
            alarms, evenings = alarms + others, evenings + fleets
            print(
                f"{axis}, {turning} nights ({0.02 * turning:.2f} deg): camera named in {found} of {fleets}, another "
                f"sensor of its vehicle in {beside}, another vehicle in {others}; "
                f"{', '.join(f'{check} {count}' for check, count in by.most_common(3))}",
                flush=True,
            )
    print(f"another vehicle is named on {alarms} of {evenings} evenings")


if __name__ == "__main__":
    main()

"""What a screen would save and lose against every frame in full: `python -m tests.benchmarks.screening --into FOLDER`.

The frames of the real drives (AUDITOR_TEST_DATA), LiDAR and three cameras, are measured in full and screened, clean and
under attacks on each sensor that stay as they are for a second. What is in the folder is not measured again. A series
is a drive in which one attack lasts for some frames. It is judged by thresholds of the other drives with every frame in
full, and with those alone that would be looked at in full: one every `--cadence` frames, and around what is unusual,
back to the first calm frame and forward to the next; each phase of the cadence is tried. What lies between ends a run.

    python -m tests.benchmarks.screening --into FOLDER [--cadence 5] [--limit 2]
    python -m tests.benchmarks.screening --cost
"""

import argparse
import os
import pickle
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from time import process_time
from typing import NamedTuple, Protocol

import numpy as np

from auditor.identification.prior import expected, log_odds, prior_of_check
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.catalogue import ON_CAMERA, ON_LIDAR, Drawing
from auditor.lab.attacks.paper import Facula, draw_wall
from auditor.lab.evaluation.sources import CleanDrive, Recorded
from auditor.measurement import FaultFeatures, measure, use_one_thread
from auditor.measurement.disparity.half_resolution import grey
from auditor.model.arrays import Floats
from auditor.model.checks import SensorCheck, counting_checks, rig_sensor_checks
from auditor.model.frames import CameraImage, Frame
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.clean_statistics import DRIVES, MATCHER, case_of
from tests.benchmarks.cost import bare_s
from tests.benchmarks.incident_series import MEASURED_HZ, Drive, drives_of
from tests.benchmarks.kinds import kinds_of
from tests.benchmarks.real_drives import LEFT_OUT, frames, without
from tests.benchmarks.scenes import Case, Scene
from tests.benchmarks.screen import screen, screened_checks

LASTS = (1, 3, 5, 10)
"""Frames that an attack lasts, a tenth of a second each."""

PAST, FEWEST, QUANTILE = 20, 3, 0.9
"""A frame stands out of so many calm ones before it, of a few at least: of the quantile of their statistics."""

BY_PRIOR = 2.5
"""The z by the prior from which on a full look is unusual, whatever came before."""

_WIDTH_PX = 1242
_FACULAS = {"R 50 mild": (50, 255), "R 75 mild": (75, 255), "R 112 mild": (112, 255), "R 75 opaque": (75, 2000)}
_ON_CAMERA: Mapping[str, tuple[str, float | None]] = {
    "paper's facula": ("facula", None),
    "spot, R 40 opaque": ("spot", None),
    "blue, R 75": ("blue", 75),
    "stripes": ("stripes", None),
    "blur, 15 px": ("blur", 15),
}
_WALLS = {f"wall {width:g} m at {away:g} m": (width, away) for width in (1.0, 2.5) for away in (8.0, 20.0)}
_ON_LIDAR: Mapping[str, tuple[str, float | None]] = {
    "ghost, 60 points at 8 m": ("ghost", None),
    "jitter, 0.3 m": ("jitter", 0.3),
    "jitter, 1 m": ("jitter", 1),
    "shift, 1 m": ("shift", 1),
    "sector of 8 deg gone": ("hidden", 8),
}


class OnImage(Protocol):
    """An attack on a camera."""

    def apply(self, image: CameraImage) -> CameraImage: ...


class Looked(NamedTuple):
    """A frame measured in full, and (M,) what its screen says."""

    case: Case
    screened: Floats


class Attacked(NamedTuple):
    """Successive frames under one attack on one sensor, from a place of the drive on."""

    attack: str
    sensor: int
    start: int
    looked: list[Looked]


class Measured(NamedTuple):
    """A drive: its frames clean, and its attacked series."""

    rig: Rig
    kinds: str
    clean: list[Looked]
    attacked: list[Attacked]


def attacks_on(series: Sequence[Frame], rig: Rig, seed: Sequence[int]) -> Iterator[tuple[str, int, list[Frame]]]:
    """Successive frames under each attack, drawn once for all of them, with its name and the attacked sensor."""

    def on(camera: int, attack: OnImage) -> list[Frame]:
        return [replace(one, images={**one.images, camera: attack.apply(one.images[camera])}) for one in series]

    for camera in rig.cameras:
        number, rng = camera.number, np.random.default_rng([*seed, camera.number])
        for name, (radius, amplitude) in _FACULAS.items():
            place = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)
            yield name, number, on(number, Facula(amplitude, radius * camera.width_px / _WIDTH_PX, *place))
        for name, (kind, size) in _ON_CAMERA.items():
            if kind != "blue" or series[0].images[number].pixels.ndim > 2:
                yield name, number, on(number, ON_CAMERA[kind](Drawing(rng, "mild", size), camera))
    rng = np.random.default_rng([*seed, LIDAR])
    wall = draw_wall(rng)
    walls = {name: replace(wall, width_m=width, range_m=away) for name, (width, away) in _WALLS.items()}
    others = {name: ON_LIDAR[kind](Drawing(rng, "mild", size)) for name, (kind, size) in _ON_LIDAR.items()}
    for name, attack in {**walls, **others}.items():
        yield name, LIDAR, [replace(one, cloud=attack.apply(one.cloud, rig)) for one in series if one.cloud is not None]


def of_three(drive: CleanDrive) -> tuple[Rig, list[Frame]]:
    """The rig and the frames of a drive without its grey left camera."""
    kept = [one.number for one in drive.rig.cameras if one.name != LEFT_OUT]
    numbers = {old: new for new, old in enumerate(kept, start=1)} | {LIDAR: LIDAR}

    def reduced(frame: Frame) -> Frame:
        images = {numbers[n]: replace(one, sensor=numbers[n]) for n, one in frame.images.items() if n in numbers}
        presence = {numbers[n]: one for n, one in frame.presence.items() if n in numbers}
        return replace(frame, images=images, presence=presence)

    return without(drive.rig, LEFT_OUT), [reduced(item) for item in drive.frames if isinstance(item, Frame)]


def screened(frame: Frame, rig: Rig) -> Floats:
    """(M,) the statistics of the screen, NaN where not measured."""
    found = screen(frame, rig)
    return np.array(sensor_statistics(screened_checks(rig), found.cells, found.shares), dtype=np.float64)


def measured(source: Recorded, name: str) -> Measured:
    """A drive, attacked from every seventh frame on."""
    with source.open(colour=True) as drives:
        rig, whole = of_three(drives[0])
    features, clean, attacked = FaultFeatures(), [], []
    for frame in whole:
        found, arrays = measure(frame, rig, MATCHER)
        case = case_of(replace(found, fault_features=features.update(arrays)), rig)
        clean.append(Looked(case, screened(frame, rig)))
    for start in range(2, len(whole) - 5, 7):
        for attack, sensor, series in attacks_on(whole[start : start + max(LASTS)], rig, [len(name), start]):
            cases = ((case_of(measure(one, rig, MATCHER)[0], rig, attack, (sensor,)), one) for one in series)
            looked = [Looked(case, screened(one, rig)) for case, one in cases]
            attacked.append(Attacked(attack, sensor, start, looked))
        print(f"{name}: attacked from frame {start} on", flush=True)
    return Measured(rig, kinds_of(whole[0]), clean, attacked)


class Standing:
    """How far statistics of some checks stand out: of those before, and of what the prior expects."""

    def __init__(self, checks: Sequence[SensorCheck]) -> None:
        self._places = list(counting_checks(tuple(checks), frozenset()))
        usual = [expected(prior_of_check(checks[place]), ()) for place in self._places]
        self._mean, self._deviation, self._within = (
            np.array([getattr(one, name) for one in usual]) for name in ("mean", "deviation", "within")
        )

    def odds(self, statistics: Sequence[Floats]) -> Floats:
        """(F, M) the log odds of the checks that count; what was not measured is small."""
        return np.asarray(np.nan_to_num(log_odds(np.array(statistics)[:, self._places]), nan=-9.0))

    def by_prior(self, odds: Floats) -> Floats:
        """(F,) the largest z by the prior."""
        return np.asarray(((odds - self._mean) / self._deviation).max(axis=1))

    def change(self, past: Sequence[Floats], now: Floats) -> float:
        """The largest rise, in deviations within drives; -inf where too few frames came before."""
        if len(past) < FEWEST:
            return -np.inf
        usual = np.quantile(np.array(past[-PAST:]), QUANTILE, axis=0)
        return float(((now - usual) / self._within).max())


@dataclass
class Looks:
    """The places of a series that are looked at in full, by what its full looks and its screens say."""

    full: Standing
    quick: Standing
    cadence: int
    limit: float
    looked: set[int] = field(default_factory=set)
    screens: int = 0

    def of(self, full: Floats, quick: Floats, phase: int) -> "Looks":
        """Look through frames of these log odds, (F, M) and (F, N)."""
        calm: list[Floats] = []
        calm_screens: list[Floats] = []
        by_prior, held, following = self.full.by_prior(full), list[int](), False

        def unusual(place: int) -> bool:
            return bool(by_prior[place] > BY_PRIOR or self.full.change(calm, full[place]) > self.limit)

        for place, now in enumerate(quick):
            beginning = len(calm_screens) < FEWEST
            if not following and (beginning or (place - phase) % self.cadence):
                self.screens += 1
                if not self.quick.change(calm_screens, now) > self.limit:
                    calm_screens.append(now)
                    if not beginning:
                        held.append(place)
                        continue
            self.looked.add(place)
            following = unusual(place)
            if following:
                for before in reversed(held):
                    self.looked.add(before)
                    if not unusual(before):
                        break
            else:
                calm.append(full[place])
            held = []
        return self


class Tally(NamedTuple):
    """Series, those of which an attacked frame is found, and shares of frames that are named: in full, and screened."""

    series: int = 0
    found: int = 0
    found_screened: int = 0
    named: float = 0.0
    named_screened: float = 0.0

    def plus(self, other: "Tally") -> "Tally":
        return Tally(*(a + b for a, b in zip(self, other, strict=True)))

    def __str__(self) -> str:
        percent = [round(100 * value / max(self.series, 1), 1) for value in self[1:]]
        return "found {:5.1f} {:5.1f}  named {:5.1f} {:5.1f}".format(*percent)


def outcome(drive: Drive, cases: Mapping[int, Case], places: Sequence[int], sensor: int) -> tuple[bool, float]:
    """Whether an attacked frame is found, and the share of them that name just the sensor, where some are looked at."""
    whole, at = drive.series(cases, MEASURED_HZ), np.array(places)
    series = replace(
        whole,
        stamps_ns=whole.stamps_ns[at],
        runs=np.cumsum(np.diff(at, prepend=at[:1]) > 1),
        statistics=whole.statistics[at],
        present=whole.present[at],
        frozen=whole.frozen[at],
        fault_scores={cause: scores[at] for cause, scores in whole.fault_scores.items()},
        brightness={key: values[at] for key, values in whole.brightness.items()},
    )
    verdicts = dict(zip(places, drive.judged(series), strict=True))
    seen = [verdicts[place] for place in cases if place in verdicts]
    return any(one.finding is not None for one in seen), sum(one.attacked == (sensor,) for one in seen) / len(cases)


def judged(one: Measured, drive: Drive, cadence: int, limit: float) -> Iterator[tuple[str, int, Tally]]:
    """What is found of each attacked series of a drive, and what would be."""
    full, quick = Standing(rig_sensor_checks(one.rig)), Standing(screened_checks(one.rig))

    def odds(looked: Sequence[Looked]) -> tuple[Floats, Floats]:
        return full.odds([each.case.statistics for each in looked]), quick.odds([each.screened for each in looked])

    clean = odds(one.clean)
    for attack, sensor, start, looked in one.attacked:
        for lasts in (most for most in LASTS if most <= len(looked)):
            cases = {start + n: each.case for n, each in enumerate(looked[:lasts])}
            whole = outcome(drive, cases, range(len(one.clean)), sensor)
            series = [of.copy() for of in clean]
            for of, attacked in zip(series, odds(looked[:lasts]), strict=True):
                of[start : start + lasts] = attacked
            for phase in range(cadence):
                seen = Looks(full, quick, cadence, limit).of(series[0], series[1], phase).looked
                found, named = outcome(drive, cases, sorted(seen), sensor)
                yield attack, lasts, Tally(1, whole[0], found, whole[1], named)


def report(drives: Mapping[str, Measured], cadence: int, limit: float) -> None:
    """Print how many clean frames are looked at, and what is lost of each attack."""
    scenes = [
        Scene(name, name, one.rig, one.kinds, tuple(each.case for each in one.clean)) for name, one in drives.items()
    ]
    tallies: dict[tuple[str, int], Tally] = defaultdict(Tally)
    for (name, one), drive in zip(drives.items(), drives_of(scenes, (1, 2, 3), Decimal("0.01")), strict=True):
        full, quick = Standing(rig_sensor_checks(one.rig)), Standing(screened_checks(one.rig))
        odds = (
            full.odds([each.case.statistics for each in one.clean]),
            quick.odds([each.screened for each in one.clean]),
        )
        looks = [Looks(full, quick, cadence, limit).of(*odds, phase) for phase in range(cadence)]
        every = cadence * len(one.clean)
        print(
            f"{name}, clean: {sum(len(look.looked) for look in looks) / every:.2f} of {len(one.clean)} frames looked "
            f"at in full, {sum(look.screens for look in looks) / every:.2f} screened"
        )
        for attack, lasts, tally in judged(one, drive, cadence, limit):
            for key in ((attack, lasts), ("all", lasts)):
                tallies[key] = tallies[key].plus(tally)
    print("per cent with every frame in full, and with the screen; attacks that last " + ", ".join(map(str, LASTS)))
    for attack in dict.fromkeys(attack for attack, _ in tallies):
        print(f"{attack:24} " + " | ".join(str(tallies[attack, lasts]) for lasts in LASTS))


def costs() -> None:
    """Print what a screen and a full look of a frame take, in pairs of bare calls."""
    for every in (False, True):
        rig, stream = frames("0009", all_cameras=every, colour=True)
        kept = list(stream)[::3]
        unit = bare_s([tuple(grey(one.images[n].pixels) for n in (1, 2, 3)) for one in kept])
        taken = []
        for look in (screened, lambda frame, rig: measure(frame, rig, MATCHER)):
            look(kept[0], rig)
            started = process_time()
            for frame in kept:
                look(frame, rig)
            taken.append((process_time() - started) / len(kept) / unit)
        print(f"LiDAR and {rig.n} cameras: a screen takes {taken[0]:.3f} of two bare calls, a full look {taken[1]:.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--cadence", type=int, default=5, help="frames, of which one is looked at in full")
    parser.add_argument("--limit", type=float, default=2.0, help="deviations from which on a rise is unusual")
    parser.add_argument("--cost", action="store_true", help="what a screen takes")
    options = parser.parse_args()
    use_one_thread()
    if options.cost:
        costs()
    if options.into is None:
        return
    options.into.mkdir(parents=True, exist_ok=True)
    drives = {}
    for name in DRIVES:
        path = options.into / f"{name}.looked"
        if not path.exists():
            source = Recorded(Path(os.environ["AUDITOR_TEST_DATA"]) / DRIVES[name])
            path.write_bytes(pickle.dumps(tuple(measured(source, name))))
        rig, kinds, clean, attacked = pickle.loads(path.read_bytes())
        series = [Attacked(*head, [Looked(*each) for each in looked]) for *head, looked in attacked]
        drives[name] = Measured(rig, kinds, [Looked(*each) for each in clean], series)
    report(drives, options.cadence, options.limit)


if __name__ == "__main__":
    main()

"""The logs of a synthetic fleet, drawn from measured scenes, and what attackers and a turning camera do to them.

The fleet has 20 vehicles of two rig kinds, 12 with three cameras and 8 with four. The frames of a log are measured
ones: a stretch of 4 s of a scene of the bank, drawn by a season that goes from clear and foliage to low sun, wet and
dusk. To their log odds are added what the vehicle and the drive have of their own, drawn; one vehicle comes back from
the workshop with other values. An attacked log has what an attack raises on measured frames: the log odds of an
attacked frame less those of the same frame clean. A turned camera changes the features of its pairs as well.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from functools import cache, partial
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import wilson
from auditor.identification.prior import OFFSET, log_odds, prior_of_check
from auditor.identification.systems import System
from auditor.model.arrays import Floats
from auditor.model.calibration import CleanFrames
from auditor.model.checks import Pair, SensorCheck, rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.rig import LIDAR, Rig
from auditor.pipeline import judge
from auditor.pipeline.refreshing.pool import Log
from auditor.store.versions.records import UsedRecording
from tests.benchmarks.rates import clean_frames, frames_of
from tests.benchmarks.scenes import Case, Scene, load
from tests.benchmarks.turned_frames import STEP_DEG, TURNED

VEHICLES = {3: 12, 4: 8}
"""By how many cameras."""
NIGHTS = 90
A_LOG = 0.1
FRAMES = 40
NAMED = 8
"""Logs of the first day that a person named clean."""
BEGINS, FLOOD, WORKSHOP, TURNS = 8, 38, 45, 60
"""The nights of the first attack, of a flood, of a visit to the workshop, and the first of a camera that turns."""
CHANGED, TURNING = 1, 2
"""The vehicle that visits the workshop, and, of those with three cameras, the one with the camera that turns."""
OFFSET_PX = COLUMNS.index("offset_px")
FIRST_DAY = date(2026, 7, 1)
EARLY, LATE = ("clear", "foliage", "overcast"), ("low sun", "wet", "dusk", "overcast")
OF_VEHICLE, OF_DRIVE = 0.2, 0.1
"""Deviations of what a vehicle and a drive have of their own, in the prior's deviations between drives."""
MILD, STRONG = ("R 75 mild", "wall 1 m"), ("R 75 opaque", "paper's facula", "wall 2.5 m")

Shift = Mapping[SensorCheck, float]


@dataclass(frozen=True, eq=False)
class Turn:
    """What a camera that turned by `degrees` changes of a frame: log odds by check, and features by pair."""

    degrees: float
    odds: Shift
    features: Mapping[Pair, Floats]


@dataclass(frozen=True, eq=False)
class Bank:
    """The clean scenes, what attacks raise by name and sensor, what turning changes, and scenes to try versions on.

    `turns` are of one street each, by degrees ascending from none.
    """

    clean: Sequence[Scene]
    shifts: Mapping[tuple[str, int], Sequence[Shift]]
    turns: Sequence[Sequence[Turn]]
    tried: Sequence[Scene]


@dataclass(frozen=True)
class Made:
    """A log of a night; `attacked` says whether somebody attacked it."""

    log: Log
    night: int
    attacked: bool


@dataclass(frozen=True)
class Told:
    """What an attacker is told of a log: the night and vehicle, and draws."""

    night: int
    vehicle: int
    rng: np.random.Generator


@dataclass(frozen=True)
class Attack:
    """What is done to a log: attacks of these names at a `scale`, on a share of its frames; `sensor` None is drawn."""

    names: Sequence[str]
    scale: float = 1.0
    frames: float = 0.4
    sensor: int | None = None


Attacker = Callable[[Told], Attack | None]


def contaminated(share: float, names: Sequence[str]) -> Attacker:
    """Attacks a share of the logs, each for 40 % of its frames."""
    return lambda told: Attack(names) if told.rng.random() < share else None


def widens(share: float) -> Attacker:
    """A share of the logs, mildly, all frames of one camera: who does so widens what drives are said to differ by."""
    return lambda told: Attack(("R 75 mild",), 1.0, 1.0, 2) if told.rng.random() < share else None


def creeps(share: float) -> Attacker:
    """A share of the logs, all frames, one camera: 1 % of a strong attack more each night."""

    def attacks(told: Told) -> Attack | None:
        if told.rng.random() >= share:
            return None
        return Attack(("R 75 opaque",), (told.night - BEGINS + 1) / 100, 1.0, 2)

    return attacks


def owns(names: Sequence[str], frames: float) -> Attacker:
    """All logs of one vehicle."""
    return lambda told: Attack(names, 1.0, frames, 2) if told.vehicle == 0 else None


def floods(told: Told) -> Attack | None:
    """All logs of one vehicle in the middle night, of which there are forty more then."""
    return Attack(MILD, 1.0, 1.0, 2) if told.vehicle == 0 and told.night == FLOOD else None


ATTACKERS: Mapping[str, Attacker | None] = {
    "nobody": None,
    "1 % of logs, mild": contaminated(0.01, MILD),
    "1 % of logs, strong": contaminated(0.01, STRONG),
    "5 % of logs, mild": contaminated(0.05, MILD),
    "5 % of logs, strong": contaminated(0.05, STRONG),
    "20 % of logs, mild": contaminated(0.2, MILD),
    "20 % of logs, strong": contaminated(0.2, STRONG),
    "40 % of logs, strong": contaminated(0.4, STRONG),
    "20 % of logs, one camera, all frames mild": widens(0.2),
    "creeps in a fifth of logs": creeps(0.2),
    "creeps in all logs": creeps(1.0),
    "owns a vehicle, all frames mild": owns(("R 75 mild",), 1.0),
    "owns a vehicle, 40 % of frames strong": owns(("R 75 opaque",), 0.4),
    "floods a day, mild": floods,
}


def bank_of(clean: Path, attacked: Path, turned: Path | None) -> Bank:
    """Read the scenes of some folders."""
    tried = load(attacked)
    shifts: dict[tuple[str, int], list[Shift]] = defaultdict(list)
    for scene in tried:
        for case, usual in _pairs(scene):
            if len(case.attacked) == 1:
                shifts[case.attack, case.attacked[0]].append(_odds(scene.rig, case, usual))
    turns = [_turns(scene) for scene in (load(turned) if turned else []) if _compares(scene)]
    return Bank(load(clean), shifts, turns, tried)


def _pairs(scene: Scene) -> Iterator[tuple[Case, Case]]:
    """The attacked cases of a scene, each with the clean one of its frame."""
    usual = {case.frame: case for case in scene.cases if not case.attack}
    return ((case, usual[case.frame]) for case in scene.cases if case.attack)


def _odds(rig: Rig, case: Case, usual: Case) -> Shift:
    """What a case has more than the clean one, in log odds; nothing in checks that neither has measured."""
    checks = rig_sensor_checks(rig)
    raised = np.zeros(len(checks))
    known = len(case.statistics)
    raised[:known] = np.nan_to_num(log_odds(case.statistics) - log_odds(usual.statistics))[: len(checks)]
    return dict(zip(checks, raised.tolist(), strict=True))


def _compares(scene: Scene) -> bool:
    """Whether all pairs of the turned camera are compared on a street."""
    [clean] = (case for case in scene.cases if not case.attack)
    return not any(np.isnan(values[OFFSET_PX]) for pair, values in clean.features.items() if TURNED in pair)


def _turns(scene: Scene) -> list[Turn]:
    """What the turned camera of a street changes, of one axis."""
    found = [Turn(0.0, {}, {})]
    for case, usual in _pairs(scene):
        axis, degrees = case.attack.split()
        if axis == "pitch":
            features = {p: np.nan_to_num(np.subtract(case.features[p], usual.features[p])) for p in case.features}
            found.append(Turn(float(degrees), _odds(scene.rig, case, usual), features))
    return found


def turned_by(turns: Sequence[Turn], degrees: float) -> Turn:
    """What turning by so much changes: on the line between two angles that were measured, and no further."""
    at = min(degrees, turns[-1].degrees)
    above = next(place for place, one in enumerate(turns) if one.degrees >= at)
    if above == 0:
        return turns[0]
    low, high = turns[above - 1], turns[above]
    share = (at - low.degrees) / (high.degrees - low.degrees)

    def between(old: float | Floats, new: float | Floats) -> float | Floats:
        return old + share * (new - old)

    return Turn(
        at,
        {check: float(between(low.odds.get(check, 0.0), high.odds[check])) for check in high.odds},
        {p: np.asarray(between(low.features.get(p, np.zeros(1)), high.features[p])) for p in high.features},
    )


def system_of(rig: Rig) -> System:
    """What frames of a rig are judged by that never lack a sensor: the checks that count then."""
    whole = judge.system_of(rig)
    every = frozenset[int]()
    columns = sorted({*whole.counting(every).tolist(), *whole.detecting(every).tolist()})
    return replace(whole, sensor_checks=tuple(whole.sensor_checks[column] for column in columns))


class Fleet:
    """The logs of all nights of the vehicles of one rig kind."""

    def __init__(self, bank: Bank, cameras: int, nights: int, seed: int) -> None:
        self._bank, self._nights, self._seed, self._cameras = bank, nights, seed, cameras
        self.rig = replace(bank.clean[0].rig, cameras=bank.clean[0].rig.cameras[:cameras])
        self.system = system_of(self.rig)
        self.vehicles = VEHICLES[cameras]
        self.frames = [clean_frames(scene, self.system) for scene in bank.clean]
        rng = np.random.default_rng((seed, cameras))
        self._own = {vehicle: self.drawn(rng, OF_VEHICLE) for vehicle in range(self.vehicles)}
        self._after = self.drawn(rng, OF_VEHICLE)

    def night(self, number: int, attacker: Attacker | None) -> list[Made]:
        """The logs of one night; the same for each attacker but for what he does."""
        rng, made = np.random.default_rng((self._seed, self.vehicles, number)), []
        bringing = [one for one in range(self.vehicles) if rng.random() < A_LOG or number == 0]
        more = 40 * (attacker is floods and number == FLOOD)
        for place, vehicle in enumerate([*bringing, *(0,) * more]):
            own = np.random.default_rng((self._seed, self.vehicles, number, place))
            told = Told(number, vehicle, np.random.default_rng((self._seed, self.vehicles, number, place, 1)))
            attack = attacker(told) if attacker and number >= BEGINS else None
            made.append(self._made(number, place, vehicle, own, attack))
        return made

    def weights(self, night: int) -> Floats:
        """How likely each scene of the bank is in a night."""
        late = night / max(self._nights - 1, 1)
        of_each = [
            0.05 + (1 - late) * (condition in EARLY) + late * (condition in LATE)
            for condition in (scene.family.partition(", ")[2] for scene in self._bank.clean)
        ]
        return np.array(of_each) / sum(of_each)

    def own(self, vehicle: int, night: int) -> Shift:
        """What a vehicle has of its own in a night."""
        return self._after if vehicle == CHANGED and night >= WORKSHOP else self._own[vehicle]

    def turned(self, vehicle: int, night: int, rng: np.random.Generator) -> Turn | None:
        """What the camera that turns changes in a night, if it is this vehicle's."""
        if not self._bank.turns or (self._cameras, vehicle) != (min(VEHICLES), TURNING) or night < TURNS:
            return None
        of_street = self._bank.turns[int(rng.integers(len(self._bank.turns)))]
        return turned_by(of_street, STEP_DEG * (night - TURNS + 1))

    def drawn(self, rng: np.random.Generator, deviations: float) -> dict[SensorCheck, float]:
        """What a vehicle or drive has of its own."""
        return {c: rng.normal(0, deviations * prior_of_check(c).between) for c in self.system.sensor_checks}

    def log(self, night: int, place: int, vehicle: int, rng: np.random.Generator) -> Log:
        """A log of a vehicle that nobody attacks."""
        return self._made(night, place, vehicle, rng, None).log

    def _made(self, night: int, place: int, vehicle: int, rng: np.random.Generator, attack: Attack | None) -> Made:
        scene = int(rng.choice(len(self.frames), p=self.weights(night)))
        start = int(rng.integers(0, self.frames[scene].frames - FRAMES + 1))
        offsets = [self.own(vehicle, night), self.drawn(rng, OF_DRIVE)]
        raised, turn = self._raised(attack, rng), self.turned(vehicle, night, rng)
        offsets += [turn.odds] if turn else []
        name = f"{self.vehicles}-{night}-{place}{'x' * (attack is not None)}"
        part = slice(start, start + FRAMES)
        log = Log(
            UsedRecording(name, name, name, f"v{vehicle}", FIRST_DAY + timedelta(days=night), False, "", FRAMES),
            cache(partial(self._clean, name, scene, part, night, offsets, raised, turn)),
            named=night == 0 and place < NAMED,
            labelled=True,
        )
        return Made(log, night, attack is not None)

    def _clean(
        self,
        name: str,
        scene: int,
        part: slice,
        night: int,
        offsets: Sequence[Shift],
        raised: Mapping[SensorCheck, Floats],
        turn: Turn | None,
    ) -> CleanFrames:
        source = self.frames[scene]
        statistics = {}
        for check, values in source.statistics.items():
            changed = log_odds(values[part]) + sum(one.get(check, 0.0) for one in offsets) + raised.get(check, 0.0)
            share = 1 / (1 + np.exp(-changed))
            statistics[check] = np.clip(share * (1 + 2 * OFFSET) - OFFSET, 0, 1)
        stamps = source.stamps_ns[part] - source.stamps_ns[part.start] + night * 86_400 * 10**9
        strengths = {cause: values[part] for cause, values in source.strengths.items()}
        if turn is not None:
            strengths = dict(self._turned_cases(scene, part, turn).strengths)
        return CleanFrames(name, stamps, {}, statistics, strengths)

    def _turned_cases(self, scene: int, part: slice, turn: Turn) -> CleanFrames:
        """A stretch of a scene with the features that a turned camera has."""
        clean = self._bank.clean[scene]
        cases = [
            replace(case, features={p: tuple(np.add(v, turn.features.get(p, 0.0))) for p, v in case.features.items()})
            for case in clean.cases[part]
        ]
        return frames_of(clean, self.system, cases)

    def _raised(self, attack: Attack | None, rng: np.random.Generator) -> dict[SensorCheck, Floats]:
        """By check and frame what an attack adds to the log odds."""
        if attack is None:
            return {}
        known = [(name, sensor) for name, sensor in self._bank.shifts if name in attack.names]
        known = [one for one in known if one[1] in self.rig.sensors and attack.sensor in (None, one[1])]
        if not known:  # walls have no camera, faculas no LiDAR
            known = [one for one in self._bank.shifts if one[0] in attack.names and one[1] == LIDAR]
        shifts = self._bank.shifts[known[int(rng.integers(len(known)))]]
        shift, where = shifts[int(rng.integers(len(shifts)))], np.zeros(FRAMES)
        count = round(attack.frames * FRAMES)
        first = int(rng.integers(0, FRAMES - count + 1))
        where[first : first + count] = attack.scale
        return {check: shift[check] * where for check in self.system.sensor_checks}


def wilson_percent(k: int, n: int) -> tuple[float, float]:
    """Both ends, in percent, of Wilson's 95 % interval of k out of n."""
    low, high = wilson(k, n)
    return 100 * low, 100 * high

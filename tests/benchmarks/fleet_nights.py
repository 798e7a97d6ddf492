r"""Nights of a synthetic fleet that is refreshed, with and without the guard, under attackers of the calibration.

The fleet is synthetic: 20 vehicles of two rig kinds, 8 with four cameras and 12 with three, each of which brings a log
in 15 % of the nights. The frames of a log are measured ones: a stretch of 4 s of a scene of the BANK, drawn by a
season that goes from clear and foliage to low sun, wet and dusk. To their log odds are added what the vehicle and the
drive have of their own, drawn; one vehicle comes back from the workshop with other values. The first 8 nights nobody
attacks; then a person confirms the version in force, and nobody looks at anything any more. An attacked log has
what an attack raises on measured frames: the log odds of an attacked frame of ATTACKED less those of the same frame
clean. What is in force at the end is tried on all of ATTACKED: how many attacks it finds, against what it finds after
the same nights without an attacker. `unguarded` is a calibration of the last logs, as many, whatever they show.

    python -m tests.benchmarks.clean_statistics --into BANK --streets 21 --first 9000 --frames 100
    python -m tests.benchmarks.clean_statistics --into ATTACKED --streets 42 --first 5000 --frames 8 \
        --attacked --every 8
    python -m tests.benchmarks.fleet_nights BANK --attacked ATTACKED [--nights 68] [--seeds 3] [--only NAME...]

Prints a row a scenario. Intervals are 95 %, of detection over the streets of ATTACKED.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime, timedelta
from decimal import Decimal
from functools import cache, partial
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import thresholds_of, wilson
from auditor.identification.prior import OFFSET, log_odds, prior_of_check
from auditor.identification.refresh_parameters import INFLUENCE
from auditor.identification.refreshing import influence
from auditor.identification.refreshing.clustered import difference_of
from auditor.model.arrays import Floats
from auditor.model.calibration import Calibration, CleanFrames, RobustThresholds
from auditor.model.checks import SensorCheck
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS
from auditor.pipeline.judge import system_of
from auditor.pipeline.refreshing.choosing import Known
from auditor.pipeline.refreshing.learning import learn
from auditor.pipeline.refreshing.night import waiting_after
from auditor.pipeline.refreshing.pool import Group, Log
from auditor.store import make_calibration
from auditor.store.versions.decisions import Decided
from auditor.store.versions.history import History, How, Move
from auditor.store.versions.records import UsedRecording
from tests.benchmarks.rates import clean_frames, judge_scene
from tests.benchmarks.scenes import Scene, load
from tests.making.stores import PROCEDURE

R = Decimal("0.01")
VEHICLES = {4: 8, 3: 12}
"""By how many cameras."""
A_LOG = 0.15
FRAMES = 40
MOST = 40
"""Logs of a calibration: fewer than the program takes, so that a run takes minutes."""
NAMED = 8
"""Logs of the first day that a person named clean."""
FIRST_DAY = date(2026, 7, 1)
EARLY, LATE = ("clear", "foliage", "overcast"), ("low sun", "wet", "dusk", "overcast")
OF_VEHICLE, OF_DRIVE = 0.2, 0.1
"""Deviations of what a vehicle and a drive have of their own, in the prior's deviations between drives."""
MILD, STRONG = ("R 75 mild", "wall 1 m"), ("R 75 opaque", "paper's facula", "wall 2.5 m")
NOW = datetime(2026, 7, 1, tzinfo=UTC)

Shift = Mapping[SensorCheck, float]


@dataclass(frozen=True, eq=False)
class Bank:
    """The clean scenes, what attacks raise by name and sensor, and the scenes that versions are tried on."""

    clean: Sequence[Scene]
    shifts: Mapping[tuple[str, int], Sequence[Shift]]
    tried: Sequence[Scene]


@dataclass(frozen=True)
class Made:
    """A log of a night; `attacked` says whether somebody attacked it."""

    log: Log
    night: int
    attacked: bool


@dataclass(frozen=True)
class Told:
    """What an attacker is told of a log: the night and vehicle, the night's share, and draws."""

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


def creeps(share: float) -> Attacker:
    """A share of the logs, all frames, one camera: 1 % of a strong attack more each night."""

    def attacks(told: Told) -> Attack | None:
        if told.rng.random() >= share:
            return None
        return Attack(("R 75 opaque",), (told.night - BEGINS) / 100, 1.0, 2)

    return attacks


def owns(names: Sequence[str], frames: float) -> Attacker:
    """All logs of one vehicle."""
    return lambda told: Attack(names, 1.0, frames, 2) if told.vehicle == 0 else None


def floods(told: Told) -> Attack | None:
    """All logs of one vehicle in the middle night, of which there are forty more then."""
    return Attack(MILD, 1.0, 1.0, 2) if told.vehicle == 0 and told.night == FLOOD else None


BEGINS, FLOOD, WORKSHOP = 8, 38, 45
"""The nights of the first attack, of a flood, and of a visit to the workshop."""
SCENARIOS: Mapping[str, Attacker | None] = {
    "nobody": None,
    "creeps 1 % a night in a fifth of logs": creeps(0.2),
    "creeps 1 % a night in all logs": creeps(1.0),
    "owns a vehicle, all frames mild": owns(("R 75 mild",), 1.0),
    "20 % of logs, mild": contaminated(0.2, MILD),
    "20 % of logs, strong": contaminated(0.2, STRONG),
    "floods a day with forty logs, mild": floods,
    "owns a vehicle, 40 % of frames strong": owns(("R 75 opaque",), 0.4),
    "5 % of logs, mild": contaminated(0.05, MILD),
    "5 % of logs, strong": contaminated(0.05, STRONG),
    "1 % of logs, mild": contaminated(0.01, MILD),
    "1 % of logs, strong": contaminated(0.01, STRONG),
}


def bank_of(clean: Sequence[Path], attacked: Sequence[Path]) -> Bank:
    """Read the scenes of some folders."""
    tried = [scene for folder in attacked for scene in load(folder)]
    shifts: dict[tuple[str, int], list[Shift]] = defaultdict(list)
    for scene in tried:
        checks = system_of(scene.rig).sensor_checks
        usual = {case.frame: log_odds(case.statistics) for case in scene.cases if not case.attack}
        for case in scene.cases:
            if len(case.attacked) == 1:
                raised = np.nan_to_num(log_odds(case.statistics) - usual[case.frame])
                shifts[case.attack, case.attacked[0]].append(dict(zip(checks, raised.tolist(), strict=True)))
    return Bank([scene for folder in clean for scene in load(folder)], shifts, tried)


class Fleet:
    """The logs of all nights of the vehicles of one rig kind."""

    def __init__(self, bank: Bank, cameras: int, nights: int, seed: int) -> None:
        self._bank, self._nights, self._seed = bank, nights, seed
        rigs = [replace(one.rig, cameras=one.rig.cameras[:cameras]) for one in bank.clean]
        self.rig: Rig = rigs[0]
        self.system = system_of(self.rig)
        self.vehicles = VEHICLES[cameras]
        self._frames = [clean_frames(scene, system_of(rig)) for scene, rig in zip(bank.clean, rigs, strict=True)]
        self._odds = [{c: log_odds(v) for c, v in one.statistics.items()} for one in self._frames]
        rng = np.random.default_rng((seed, cameras))
        self._own = {vehicle: self._draw(rng, OF_VEHICLE) for vehicle in range(self.vehicles)}
        self._after = {1: self._draw(rng, OF_VEHICLE)}

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

    def _made(self, night: int, place: int, vehicle: int, rng: np.random.Generator, attack: Attack | None) -> Made:
        late = night / max(self._nights - 1, 1)
        weights = np.array([_weight(scene.family.partition(", ")[2], late) for scene in self._bank.clean])
        scene = int(rng.choice(len(weights), p=weights / weights.sum()))
        start = int(rng.integers(0, self._frames[scene].frames - FRAMES + 1))
        own = self._after.get(vehicle, {}) if night >= WORKSHOP else {}
        own, drive = own or self._own[vehicle], self._draw(rng, OF_DRIVE)
        raised = self._raised(attack, rng)
        name = f"{self.vehicles}-{night}-{place}{'x' * (attack is not None)}"
        log = Log(
            UsedRecording(name, name, name, f"v{vehicle}", FIRST_DAY + timedelta(days=night), False, "", FRAMES),
            cache(partial(self._clean, name, scene, slice(start, start + FRAMES), night, (own, drive), raised)),
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
    ) -> CleanFrames:
        source = self._frames[scene]
        statistics = {}
        for check, odds in self._odds[scene].items():
            changed = odds[part] + sum(one[check] for one in offsets) + raised.get(check, 0.0)
            share = 1 / (1 + np.exp(-changed))
            statistics[check] = np.clip(share * (1 + 2 * OFFSET) - OFFSET, 0, 1)
        start_ns = night * 86_400 * 10**9
        stamps = source.stamps_ns[part] - source.stamps_ns[part.start] + start_ns
        strengths = {cause: values[part] for cause, values in source.strengths.items()}
        return CleanFrames(name, stamps, {}, statistics, strengths)

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

    def _draw(self, rng: np.random.Generator, deviations: float) -> dict[SensorCheck, float]:
        return {c: rng.normal(0, deviations * prior_of_check(c).between) for c in self.system.sensor_checks}


@dataclass
class Outcome:
    """What became of a scenario in one seed: nights by what was decided, and logs by what became of them."""

    decided: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    false_promotions: int = 0
    attacked: int = 0
    attacked_waiting: int = 0
    attacked_in_force: int = 0
    in_force: int = 0
    clean: int = 0
    clean_waiting: int = 0
    begun: int | None = None
    alarm: int | None = None
    seen: int | None = None
    """The first nights with an attacked log, with a held or refused candidate, and with an attacked log that waits."""
    found: tuple[Sequence[int], Sequence[int], Sequence[int]] = ((), (), ())
    """By street: attacks found by the version in force, by the unguarded calibration, and all."""
    reasons: dict[str, int] = field(default_factory=lambda: defaultdict(int))


def nights_of(bank: Bank, cameras: int, nights: int, seed: int, attacker: Attacker | None) -> Outcome:
    """Refresh a fleet for some nights."""
    influence.INFLUENCE = replace(INFLUENCE, most_drives=MOST)  # type: ignore[attr-defined]
    fleet, outcome = Fleet(bank, cameras, nights, seed), Outcome()
    group = Group(History(fleet.rig.kind, PROCEDURE), fleet.rig)
    known, every, in_force = Known(), list[Made](), None
    for night in range(nights):
        if night == BEGINS:
            known = replace(known, confirmed=in_force)
        new = fleet.night(night, attacker)
        every += new
        logs = [*group.logs, *(made.log for made in new if night or made.log.named)]
        group = replace(group, logs=logs)
        learnt = learn(group, known, [], R)
        decision, attacked = learnt.decision, {one.log.used.recording_id for one in every if one.attacked}
        if attacked and outcome.begun is None:
            outcome.begun = night
        outcome.decided[decision.decided.value] += 1
        if decision.decided in (Decided.HELD, Decided.REFUSED):
            outcome.reasons[decision.reasons[0][:60]] += 1
            if outcome.alarm is None and outcome.begun is not None:
                outcome.alarm = night
        if decision.decided is Decided.PROMOTED and learnt.calibration is not None:
            in_force = learnt.calibration
            how = How.REFRESHED if night else How.PROMOTED
            moves = (*group.history.moves, Move(in_force.calibration_id, how, NOW))
            group = replace(group, history=replace(group.history, moves=moves))
            known = replace(known, parent=in_force, confirmed=known.confirmed or in_force, before=decision.included)
            outcome.false_promotions += bool(attacked & set(in_force.recordings))
        waiting = {one.recording_id: one for one in waiting_after(decision, known.waiting, NOW)}
        known = replace(known, waiting=waiting)
        if outcome.seen is None and attacked & waiting.keys():
            outcome.seen = night
    assert in_force is not None
    outcome.attacked, outcome.clean = len(attacked), len(every) - len(attacked)
    outcome.attacked_waiting = len(attacked & waiting.keys())
    outcome.clean_waiting = len(waiting.keys() - attacked)
    outcome.attacked_in_force, outcome.in_force = len(attacked & set(in_force.recordings)), len(in_force.recordings)
    naive = make_calibration(fleet.rig.kind, PROCEDURE, [made.log.frames() for made in every[-MOST:]])
    outcome.found = _tried(bank, fleet, in_force, naive)
    return outcome


def _tried(
    bank: Bank, fleet: Fleet, guarded: Calibration, unguarded: Calibration
) -> tuple[list[int], list[int], list[int]]:
    """By street: attacks that both find, and all."""
    found: tuple[list[int], list[int], list[int]] = ([], [], [])
    thresholds = [thresholds_of(one.clean, fleet.system, R) for one in (guarded, unguarded)]
    for scene in bank.tried:
        for count, one in zip(found, thresholds, strict=False):
            count.append(_found(scene, fleet, one))
        found[2].append(sum(bool(c.attack) and set(c.attacked) <= set(fleet.system.sensors) for c in scene.cases))
    return found


def _found(scene: Scene, fleet: Fleet, thresholds: RobustThresholds) -> int:
    judged = judge_scene(scene, fleet.system, thresholds, None)
    return sum(one.robust.kind in FINDINGS for one in judged if one.case.attack)


def _weight(condition: str, late: float) -> float:
    return 0.05 + (1 - late) * (condition in EARLY) + late * (condition in LATE)


def _lost(some: Sequence[Outcome], usual: Sequence[Outcome], which: int) -> str:
    """The share of attacks that are no longer found, against the guarded fleet of nobody."""
    lost = [
        sum(before.found[0][street] - after.found[which][street] for before, after in zip(usual, some, strict=True))
        for street in range(len(usual[0].found[2]))
    ]
    cases = [sum(one.found[2][street] for one in usual) for street in range(len(usual[0].found[2]))]
    return str(difference_of(lost, cases))


def row(name: str, some: Sequence[Outcome], usual: Sequence[Outcome]) -> str:
    """A row of the table: all seeds together."""

    def total(of: str) -> int:
        return sum(getattr(one, of) for one in some)

    nights = sum(sum(one.decided.values()) for one in some)
    decided = [sum(one.decided[which] for one in some) for which in ("promoted", "held", "refused")]
    delays = [
        str(min(one.seen if one.seen is not None else 999, one.alarm if one.alarm is not None else 999) - one.begun)
        for one in some
        if one.begun is not None and (one.seen is not None or one.alarm is not None)
    ]
    low, high = wilson(total("clean_waiting"), total("clean"))
    cells = [
        name,
        f"{decided[0]} of {nights}",
        f"{decided[1]} / {decided[2]}",
        str(total("false_promotions")),
        f"{total('attacked_in_force')} of {total('in_force')}",
        f"{total('attacked_waiting')} of {total('attacked')}",
        f"{total('clean_waiting')} of {total('clean')} ({100 * low:.1f} to {100 * high:.1f} %)",
        ", ".join(delays) or "-",
        _lost(some, usual, 0),
        _lost(some, usual, 1),
    ]
    return f"| {' | '.join(cells)} |"


HEAD = (
    "| attacker | nights promoted | held / refused | promoted with an attacked log | attacked logs in force at the end "
    "| attacked logs that wait | clean logs that wait | nights to the first alarm | attacks lost | unguarded |"
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("bank", type=Path, nargs="+")
    parser.add_argument("--attacked", type=Path, nargs="+", required=True)
    parser.add_argument("--nights", type=int, default=68)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cameras", type=int, nargs="+", default=[3])
    parser.add_argument("--only", nargs="+", choices=SCENARIOS)
    options = parser.parse_args()
    names = options.only or list(SCENARIOS)
    names = [name for name in SCENARIOS if name in names or name == "nobody"]
    print(HEAD, "|---" * HEAD.count(" | ") + "|---|", sep="\n")
    with ProcessPoolExecutor(options.jobs) as pool:
        for cameras in options.cameras:
            bring = partial(_of_seed, options.bank, options.attacked, cameras, options.nights)
            found = {name: [pool.submit(bring, seed, name) for seed in range(options.seeds)] for name in names}
            usual = [one.result() for one in found["nobody"]]
            for name, some in found.items():
                outcomes = [one.result() for one in some]
                print(
                    row(name if cameras == min(VEHICLES) else f"{name} ({cameras} cameras)", outcomes, usual),
                    flush=True,
                )
                for outcome in outcomes:
                    print(f"  {dict(outcome.decided)} {dict(outcome.reasons)}", file=sys.stderr, flush=True)


_bank = cache(bank_of)


def _of_seed(
    bank: Sequence[Path], attacked: Sequence[Path], cameras: int, nights: int, seed: int, name: str
) -> Outcome:
    return nights_of(_bank(tuple(bank), tuple(attacked)), cameras, nights, seed, SCENARIOS[name])


if __name__ == "__main__":
    main()

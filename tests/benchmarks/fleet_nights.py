r"""Nights of a synthetic fleet that is refreshed, with and without the guard, under attackers of the calibration.

The fleet is that of `fleet_bank`: 20 vehicles of two rig kinds, 90 nights, a season, a visit to a workshop, a camera
that turns. The first 8 nights nobody attacks; then a person confirms the version in force, and nobody looks at anything
any more. What is in force at the end is tried on all of ATTACKED: how many attacks it finds, against what it finds
after the same nights without an attacker. `unguarded` is a calibration of the last logs, as many, whatever they show.

    python -m tests.benchmarks.clean_statistics --into BANK --streets 21 --first 9000 --frames 100
    python -m tests.benchmarks.clean_statistics --into ATTACKED --streets 42 --first 5000 --frames 8 \
        --attacked --every 8
    python -m tests.benchmarks.turned_streets --into TURNED
    python -m tests.benchmarks.fleet_nights --bank BANK --attacked ATTACKED --turned TURNED --kept FOLDER \
        [--seeds 0 1 2] [--only NAME...]

What became of each attacker, seed and rig kind is kept in FOLDER, and is not drawn again. Prints a row an attacker, of
all that is kept. Intervals are 95 %: of detection and of false promotions over fleets (a seed of a rig kind) or over
streets, of logs Wilson's.
"""

import argparse
import pickle
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from decimal import Decimal
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.refresh_parameters import INFLUENCE
from auditor.identification.refreshing import influence
from auditor.identification.refreshing.drives import Drive, DriveScores, Folds, shown_by
from auditor.identification.refreshing.gate import difference_of, share_of
from auditor.identification.robust import findings_alone
from auditor.identification.scores import CleanDrives
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, CleanFrames, RobustThresholds
from auditor.model.measurement import Procedure
from auditor.model.rig_kind import RigKind
from auditor.pipeline.refreshing import choosing, learning
from auditor.pipeline.refreshing.choosing import RigKindState
from auditor.pipeline.refreshing.learning import Learnt, learn
from auditor.pipeline.refreshing.night import waiting_after
from auditor.pipeline.refreshing.pool import LogGroup
from auditor.store.calibrations import make_calibration
from auditor.store.records import content_id
from auditor.store.versions.decisions import Decision, RefreshOutcome
from auditor.store.versions.history import EntryIntoForce, History, Move
from tests.benchmarks.fleet_bank import (
    ATTACKERS,
    BEGINS,
    NIGHTS,
    TURNING,
    TURNS,
    VEHICLES,
    Attacker,
    Bank,
    Fleet,
    Made,
    bank_of,
    wilson_percent,
)
from tests.benchmarks.rates import clean_frames, frames_of
from tests.benchmarks.scenes import Scene
from tests.making.stores import PROCEDURE

R = Decimal("0.01")
MOST = 24
"""Logs of a calibration beside those that were named: fewer than the program takes, so that a run takes minutes."""
AGAIN = 7
"""Nights after which a log of the version in force is judged by the others again; the program does so every night."""
DAY_NS = 86_400 * 10**9
NOW = datetime(2026, 7, 1, tzinfo=UTC)


@dataclass
class Outcome:
    """What became of a fleet: nights by what was decided, and logs by what became of them."""

    decided: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    false_promotions: int = 0
    false_unguarded: int = 0
    since: int = 0
    """Nights since the first attacked log, those with an attacked log in force, guarded and not."""
    attacked: int = 0
    attacked_waiting: int = 0
    attacked_in_force: int = 0
    in_force: int = 0
    clean: int = 0
    clean_waiting: int = 0
    turned: int = 0
    turned_in_force: int = 0
    begun: int | None = None
    alarm: int | None = None
    """The first nights with an attacked log, and with one that waits or a candidate that is held or refused."""
    found: tuple[Sequence[int], Sequence[int], Sequence[int]] = ((), (), ())
    """By street: attacks found by the version in force, by the unguarded calibration, and all."""
    creep: float = 0.0


class Again:
    """Judges logs by the others: new ones every time, those of before in one of some nights, to save time.

    Else they show what they did when they were judged last.
    """

    def __init__(self) -> None:
        self._known: dict[str, tuple[DriveScores, int]] = {}

    def shown_by_others(self, drives: Sequence[Drive], system: System, r: Decimal) -> list[DriveScores]:
        """As the program's function of this name."""
        tonight = max(drive.clean.stamps_ns[0] for drive in drives) // DAY_NS
        folds = Folds([drive.source for drive in drives])
        every = CleanDrives.of([drive.clean for drive in drives], system.sensor_checks)
        thresholds = cache(lambda key: every.thresholds(system.judged_together, r, used=used[key]))
        used, found = {}, []
        for place, drive in enumerate(drives):
            name = drive.source.recording_id
            shown, judged = self._known.get(name, (None, 0))
            if shown is None or tonight - judged in (0, *range(AGAIN, 99)):
                used[folds.of(place)] = np.isin(np.arange(len(drives)), folds.others(place))
                shown = shown_by(drive.clean, system, thresholds(folds.of(place)))
                self._known[name] = shown, tonight
            found.append(shown)
        return found


class Nights:
    """A fleet that is refreshed every night."""

    def __init__(self, fleet: Fleet, known_nights: dict[tuple[str, ...], Learnt]) -> None:
        self.fleet, self._known_nights = fleet, known_nights
        self.group = LogGroup(History(fleet.rig.kind, PROCEDURE), fleet.rig)
        self.known, self.every = RigKindState(), list[Made]()
        self._last: tuple[object, Learnt] | None = None

    @property
    def attacked(self) -> set[str]:
        """The recordings that somebody attacked."""
        return {one.log.used.recording_id for one in self.every if one.attacked}

    def refresh(self, night: int, new: Sequence[Made]) -> Decision:
        """One refresh; the version in force is that of `known`."""
        self.every += new
        logs = [*self.group.logs, *(made.log for made in new if night or made.log.named)]
        self.group = replace(self.group, logs=logs)
        learnt = self._learn()
        decision = learnt.decision
        if decision.decided is RefreshOutcome.PROMOTED and learnt.calibration is not None:
            how, history = EntryIntoForce.REFRESHED if night else EntryIntoForce.PROMOTED, self.group.history
            moves = (*history.moves, Move(learnt.calibration.calibration_id, how, NOW))
            self.group = replace(self.group, history=replace(history, moves=moves))
            confirmed = self.known.confirmed or learnt.calibration
            self.known = replace(self.known, parent=learnt.calibration, confirmed=confirmed, before=decision.included)
        waiting = {one.recording_id: one for one in waiting_after(decision, self.known.waiting, NOW)}
        self.known = replace(self.known, waiting=waiting)
        return decision

    def _learn(self) -> Learnt:
        """What the program decides; known where all is as it was last night, or as in a fleet that nobody attacks."""
        parent = self.known.parent.calibration_id if self.known.parent else ""
        confirmed = self.known.confirmed.calibration_id if self.known.confirmed else ""
        key = (parent, confirmed, *(log.used.recording_id for log in self.group.logs), "", *sorted(self.known.waiting))
        if key not in self._known_nights:
            self._known_nights[key] = learn(self.group, self.known, [], R)
        return self._known_nights[key]


@lru_cache(8)
def _known_thresholds(clean: tuple[CleanFrames, ...], system: System, r: Decimal) -> RobustThresholds:
    return thresholds_of(clean, system, r)


def _thresholds(clean: Sequence[CleanFrames], system: System, r: Decimal) -> RobustThresholds:
    """As the program's, which are the same for one version in two nights."""
    return _known_thresholds(tuple(clean), system, r)


def _calibration(kind: RigKind, procedure: Procedure, clean: Sequence[CleanFrames]) -> Calibration:
    """A calibration whose id is that of the names of its logs: hashing all their frames takes long."""
    names = sorted(one.recording_id for one in clean)
    return Calibration(content_id("calibration", *names), kind, procedure, tuple(clean))


def nights_of(
    bank: Bank, fleet: Fleet, nights: int, attacker: Attacker | None, known: dict[tuple[str, ...], Learnt]
) -> Outcome:
    """Refresh a fleet for some nights."""
    influence.INFLUENCE = replace(INFLUENCE, most_drives=MOST)  # type: ignore[attr-defined]
    learning.system_of = lambda _rig: fleet.system  # type: ignore[attr-defined, assignment]
    choosing.shown_by_others = Again().shown_by_others  # type: ignore[attr-defined]
    choosing.thresholds_of = learning.thresholds_of = _thresholds  # type: ignore[attr-defined, assignment]
    learning.make_calibration = _calibration  # type: ignore[attr-defined, assignment]
    run, outcome = Nights(fleet, known), Outcome()
    for night in range(nights):
        if night == BEGINS:
            run.known = replace(run.known, confirmed=run.known.parent)
        decision = run.refresh(night, fleet.night(night, attacker))
        attacked = run.attacked
        outcome.decided[decision.decided.value] += 1
        if decision.decided in (RefreshOutcome.HELD, RefreshOutcome.REFUSED):
            outcome.reasons[decision.reasons[0][:60]] += 1
        if not attacked:
            continue
        outcome.since += 1
        outcome.begun = night if outcome.begun is None else outcome.begun
        assert run.known.parent is not None
        outcome.false_promotions += bool(attacked & set(run.known.parent.recordings))
        outcome.false_unguarded += any(made.attacked for made in run.every[-MOST:])
        doubted = (
            decision.decided in (RefreshOutcome.HELD, RefreshOutcome.REFUSED) or attacked & run.known.waiting.keys()
        )
        if outcome.alarm is None and doubted:
            outcome.alarm = night
    return _ended(bank, run, outcome, decision)


def _ended(bank: Bank, run: Nights, outcome: Outcome, last: Decision) -> Outcome:
    """The outcome with what is in force at the end."""
    in_force, waiting, attacked = run.known.parent, run.known.waiting.keys(), run.attacked
    assert in_force is not None
    learnt_from = set(in_force.recordings)
    turned = {
        made.log.used.recording_id
        for made in run.every
        if (run.fleet.vehicles, made.log.used.vehicle) == (VEHICLES[3], f"v{TURNING}") and made.night >= TURNS
    }
    outcome.turned, outcome.turned_in_force = len(turned), len(turned & learnt_from)
    outcome.attacked, outcome.clean = len(attacked), len(run.every) - len(attacked | turned)
    outcome.attacked_waiting = len(attacked & waiting)
    outcome.clean_waiting = len(waiting - attacked - turned)
    outcome.attacked_in_force, outcome.in_force = len(attacked & learnt_from), len(learnt_from)
    outcome.creep = last.creep or 0.0
    fleet, r = run.fleet, R
    naive = make_calibration(fleet.rig.kind, PROCEDURE, [made.log.frames() for made in run.every[-MOST:]])
    guarded, unguarded = (thresholds_of(one.clean, fleet.system, r) for one in (in_force, naive))
    cases = [
        sum(bool(c.attack) and set(c.attacked) <= set(fleet.system.sensors) for c in one.cases) for one in bank.tried
    ]
    after, naively = ([_found(scene, fleet.system, one) for scene in bank.tried] for one in (guarded, unguarded))
    outcome.found = after, naively, cases
    return outcome


def _found(scene: Scene, system: System, thresholds: RobustThresholds) -> int:
    """How many attacks on a scene are found, each frame by itself in the drive of the clean ones."""
    own, attacked = _tried(scene, system)
    return int(
        np.count_nonzero(findings_alone(attacked, system, for_clean_drive(thresholds, system.sensor_checks, own)))
    )


@cache
def _tried(scene: Scene, system: System) -> tuple[CleanFrames, FrameSeries]:
    """The clean frames of a scene, and its attacked ones, each a run of its own."""
    attacked = [one for one in scene.cases if one.attack and set(one.attacked) <= set(system.sensors)]
    statistics = frames_of(scene, system, attacked).statistics_of(system.sensor_checks)
    number, here = np.arange(len(attacked)), np.ones((len(attacked), len(system.sensors)), dtype=np.bool_)
    return clean_frames(scene, system), FrameSeries(number * 10**9, number, statistics, here, ~here, {}, {})


def _lost(some: Mapping[tuple[int, int], Outcome], usual: Mapping[tuple[int, int], Outcome], which: int) -> str:
    """The share of attacks that are no longer found, against the guarded fleet of nobody; intervals over streets."""
    lost, cases = Counter[int](), Counter[int]()
    for key, after in some.items():
        before = usual[key]
        for street, of in enumerate(before.found[2]):
            lost[street] += before.found[0][street] - after.found[which][street]
            cases[street] += of
    return str(difference_of([lost[one] for one in sorted(cases)], [cases[one] for one in sorted(cases)]))


def nights_row(name: str, outcomes: Sequence[Outcome]) -> str:
    """A row of the first table: nights and logs of all seeds and rig kinds together."""

    def total(of: str) -> int:
        return sum(getattr(one, of) for one in outcomes)

    def nights(of: str) -> str:
        share = share_of([getattr(one, of) for one in outcomes], [one.since for one in outcomes])
        return f"{100 * share.value:.0f} ({100 * share.low:.0f} to {100 * share.high:.0f})" if total("since") else "-"

    decided = sum((one.decided for one in outcomes), Counter[str]())
    cells = [
        name,
        f"{decided['held']} / {decided['refused']}",
        nights("false_promotions"),
        nights("false_unguarded"),
        _logs(total("attacked_waiting"), total("attacked")),
        _logs(total("clean_waiting"), total("clean")),
        _alarms(outcomes),
    ]
    return f"| {' | '.join(cells)} |"


def lost_row(name: str, some: Mapping[tuple[int, int], Outcome], usual: Mapping[tuple[int, int], Outcome]) -> str:
    """A row of the second table: what is in force at the end, and which attacks it does not find."""
    in_force = sum(one.attacked_in_force for one in some.values()), sum(one.in_force for one in some.values())
    turned = sum(one.turned_in_force for one in some.values()), sum(one.turned for one in some.values())
    cells = [
        name,
        "{} of {}".format(*in_force),
        _lost(some, usual, 0),
        _lost(some, usual, 1),
        "{} of {}".format(*turned),
    ]
    return f"| {' | '.join(cells)} |"


def _logs(k: int, n: int) -> str:
    low, high = wilson_percent(k, n)
    return f"{k} of {n} ({low:.0f} to {high:.0f} %)" if n else "-"


def _alarms(outcomes: Sequence[Outcome]) -> str:
    """The nights from the first attacked log to the first alarm: median and range, and of how many fleets."""
    begun = [one for one in outcomes if one.begun is not None]
    delays = sorted(one.alarm - (one.begun or 0) for one in begun if one.alarm is not None)
    if not delays:
        return "-"
    return f"{delays[len(delays) // 2]} ({delays[0]} to {delays[-1]}), {len(delays)} of {len(begun)}"


NIGHTS_HEAD = (
    "| attacker | held / refused | an attacked log in force, % | unguarded | attacked logs that wait "
    "| clean logs that wait | first alarm after |"
)
LOST_HEAD = "| attacker | attacked logs in force | attacks lost | unguarded | turned logs in force |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bank", type=Path, required=True)
    parser.add_argument("--attacked", type=Path, required=True)
    parser.add_argument("--turned", type=Path, required=True)
    parser.add_argument("--kept", type=Path, required=True)
    parser.add_argument("--nights", type=int, default=NIGHTS)
    parser.add_argument("--seeds", type=int, nargs="*", default=[0, 1, 2])
    parser.add_argument("--only", nargs="+", choices=ATTACKERS)
    options = parser.parse_args()
    options.kept.mkdir(parents=True, exist_ok=True)
    bank = bank_of(options.bank, options.attacked, options.turned)
    for seed in options.seeds:
        for cameras in VEHICLES:
            fleet, known = Fleet(bank, cameras, options.nights, seed), dict[tuple[str, ...], Learnt]()
            for name in options.only or ATTACKERS:
                path = options.kept / f"{name}, {cameras} cameras, {seed}.pickle"
                if not path.exists():
                    shared = dict(known)
                    outcome = nights_of(bank, fleet, options.nights, ATTACKERS[name], shared)
                    known = shared if ATTACKERS[name] is None else known
                    path.write_bytes(pickle.dumps(outcome))
                    print(path.stem, dict(outcome.decided), dict(outcome.reasons), flush=True)
    usual = _kept(options.kept, "nobody")
    every = {name: some for name in ATTACKERS if (some := _kept(options.kept, name))}
    print(f"{len(usual)} fleets of {options.nights} nights", NIGHTS_HEAD, _rule(NIGHTS_HEAD), sep="\n")
    for name, some in every.items():
        print(nights_row(name, list(some.values())))
    print("", LOST_HEAD, _rule(LOST_HEAD), sep="\n")
    for name, some in every.items():
        print(lost_row(name, some, usual))


def _rule(head: str) -> str:
    return "|---" * (head.count(" | ") + 1) + "|"


def _kept(folder: Path, name: str) -> dict[tuple[int, int], Outcome]:
    """What became of an attacker, by seed and rig kind."""
    found = {}
    for path in sorted(folder.glob(f"{name}, ? cameras, *.pickle")):
        _, cameras, seed = path.stem.rsplit(", ", 2)
        found[int(seed), int(cameras[0])] = pickle.loads(path.read_bytes())
    return found


if __name__ == "__main__":
    main()

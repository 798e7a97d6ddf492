"""What each rule of the judge is for: the figures without it, one rule at a time.

Reads scenes that `python -m tests.benchmarks.clean_statistics --attacked --constant` measured of real drives, its
streets, and the folders of `attack_kinds`, `benign` and `causes` with real drives. Nothing is measured anew:

    python -m tests.benchmarks.ablations REAL --kinds KINDS --streets STREETS --faults BENIGN CAUSES [--since WORD]

A rule whose row is that of the judge that ships is a rule that no real frame, no attack and no fault needs.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from decimal import Decimal
from multiprocessing import get_context
from pathlib import Path
from unittest import mock

from auditor.identification import causes, drive_level, faults, prior, robust
from auditor.identification import parameters as judging
from auditor.identification.evidence_parameters import ALERTS, DRIVE_LEVEL, INCIDENTS, LIKELIHOOD, OWN_AT
from auditor.identification.evidence_parameters import THROWN_LIGHT as LIT
from auditor.model.arrays import Floats
from auditor.model.checks import Check
from auditor.model.verdict import Cause, VerdictKind
from tests.benchmarks import durations, held_light, measured_series, rates
from tests.benchmarks.incident_series import MEASURED_HZ, Tally, drives_of
from tests.benchmarks.judged_drives import calibrated_by, outcome
from tests.benchmarks.lasting_faults import CLEAN
from tests.benchmarks.measured_series import Drive, judged, kept_drive, learn
from tests.benchmarks.rates import judge_all
from tests.benchmarks.scenes import Scene, load

R = Decimal("0.01")
FOUR, THREE = (1, 2, 3, 4), (1, 2, 3)
WEAK = frozenset({"R 50 mild", "R 75 mild"})
OF_LIDAR = frozenset({"wall 1 m", "wall 2.5 m", "wall 2.5 m at 20 m", "sector of 8 deg gone"})
HELD = "2 s"
LASTING = ("R 75 mild", "R 112 mild", "paper's facula")
INF = float("inf")
_SCORED_CAUSES = (Cause.LATE, Cause.DISPLACED, Cause.EXPOSURE, Cause.WHITE_BALANCE, Cause.RAIN, Cause.DARK)
_READERS = (measured_series, rates)

Change = Callable[[ExitStack], None]
_FORK = get_context("fork")


@dataclass(frozen=True)
class Rule:
    """A rule of the judge, and how it is left out."""

    name: str
    without: Change


def numbers(group: object, **values: object) -> Change:
    """Leave a rule out by other values of its group."""

    def change(stack: ExitStack) -> None:
        for name, value in values.items():
            before = getattr(group, name)
            object.__setattr__(group, name, value)
            stack.callback(object.__setattr__, group, name, before)

    return change


def replaced(owner: object, name: str, value: object) -> Change:
    """Leave a rule out by another function or table."""
    return lambda stack: stack.enter_context(mock.patch.object(owner, name, value))


def both(*changes: Change) -> Change:
    def change(stack: ExitStack) -> None:
        for one in changes:
            one(stack)

    return change


def flat(name: str) -> Change:
    """Leave one curve of light on a lens out."""
    return numbers(LIT, **{name: (0.0,) * len(getattr(LIT, name))})


def without_quarter(stack: ExitStack) -> None:
    """Leave out that the quietest quarter of a drive says its level where all of it does not."""
    usual = drive_level.own_level

    def without(*values: Floats) -> drive_level.OwnLevel | None:
        own = usual(*values)
        return own and own._replace(quarter=INF)

    replaced(drive_level, "own_level", without)(stack)


def without_cause(*causes: Cause) -> Change:
    usual = faults.fault_scores

    def fewer(*args: object, **options: object) -> dict:
        return {key: value for key, value in usual(*args, **options).items() if key[0] not in causes}

    return both(*(replaced(one, "fault_scores", fewer) for one in _READERS))


def one_prior(check: Check, name: str) -> Change:
    """One prior of a check, however many cameras take part."""
    priors = tuple(one for one in check.kind.priors if one.name == name)
    return replaced(check, "kind", replace(check.kind, priors=priors))


def rules() -> Iterator[Rule]:
    """The rules, in the order of the judge."""
    light, hierarchy = judging.LIGHT_OF_CAUSES, judging.HIERARCHY
    yield Rule("as it ships", lambda stack: None)
    yield Rule("one prior of added light", one_prior(Check.ADDED_LIGHT, "light"))
    yield Rule("one prior of removed light", one_prior(Check.REMOVED_LIGHT, "darkness"))
    yield Rule("one prior of inconsistency", one_prior(Check.PHOTOMETRIC_INCONSISTENCY, "inconsistency"))
    yield Rule("tails", replaced(prior.Prior, "tail", property(lambda self: 1.5)))
    yield Rule("the drive's own level", numbers(hierarchy, most_learnt=0.0))
    yield Rule("busier stretches of a drive", numbers(hierarchy, of_stretches=0.5))
    yield Rule("an own level's farthest", numbers(DRIVE_LEVEL, farthest=INF))
    yield Rule("the quietest quarter of a drive", without_quarter)
    yield Rule("levels of a group", replaced(drive_level, "group_of", lambda *args: None))
    of_attacked = {"farthest": INF, "farther": 0.0, "widest_values": INF}
    yield Rule("bounds against attacked drives", numbers(hierarchy, **of_attacked))
    yield Rule("the narrowest deviations", numbers(hierarchy, narrowest=0.0))
    yield Rule("dependent checks", numbers(judging.JOINT_TAIL, independent=1.0))
    yield Rule("limits of a score", numbers(judging.SCORE_LIMITS, lowest=-40.0, highest=40.0))
    yield Rule("the curve of the other sensors", numbers(LIKELIHOOD, of_rest=(0.0,) * len(LIKELIHOOD.of_rest)))
    yield Rule("a price of several sensors", numbers(LIKELIHOOD, of_several=0.0))
    straight = tuple(x - 2 for x in OWN_AT)
    yield Rule("curves of an attacked sensor", numbers(LIKELIHOOD, of_camera=straight, of_lidar=straight))
    yield Rule("a curve of the LiDAR by itself", numbers(LIKELIHOOD, of_lidar=LIKELIHOOD.of_camera))
    yield Rule("duty of a strobe", numbers(INCIDENTS, duty=1.0))
    yield Rule("less evidence of what is explained", numbers(INCIDENTS, explained_share=1.0))
    yield Rule("sensors apart within an event", numbers(INCIDENTS, contested_share=INF))
    yield Rule("correlation of successive frames", numbers(INCIDENTS, correlation=0.0))
    yield Rule("stretches of a second", replaced(robust._Judge, "lasting", lambda self: []))
    yield Rule("alerts", numbers(ALERTS, share=INF, chance=1e-300))
    yield Rule("alerts by share", numbers(ALERTS, share=INF))
    yield Rule("light of one colour or in rows", numbers(light, least_thrown=INF))
    yield Rule("how long light lasts", replaced(causes.CameraScores, "_of_time", property(lambda self: 0.0)))
    yield Rule("light lasts: beyond a gap", numbers(light, further_s=0.0))
    for name in ("removed", "inconsistent", "darker", "saturated"):
        yield Rule(f"light on a lens: {name}", flat(f"of_{name}"))
    yield Rule("light on a lens", replaced(faults, "of_lens", lambda seen: ()))
    yield Rule("tones: any", replaced(faults, "by_tone", lambda *args: True))
    yield Rule("tones: unchanged", numbers(light, unchanged=-INF))
    yield Rule("tones: hardly any light", numbers(light, hardly_added=-INF))
    yield Rule("dazzled", numbers(judging.FAULT_SCORES, dazzled=INF))
    yield Rule("the strongest is covered", replaced(faults, "_covers_strongest", lambda *args: True))
    yield Rule("tilt by px", numbers(judging.FAULT_SCORES, tilted_by_px=0.0))
    yield Rule("bias by px", numbers(judging.FAULT_SCORES, biased_by_px=0.0))
    for cause in _SCORED_CAUSES:
        yield Rule(f"cause: {cause.value}", without_cause(cause))


def single_frames(scenes: Sequence[Scene]) -> list[str]:
    """Clean frames raised, weak lights, other lights and attacks on the LiDAR named, and other sensors named."""
    found = judge_all(scenes, FOUR, R)
    clean = [one for one in found if not one.case.attack]
    attacked = [one for one in found if one.case.attack]
    groups = (
        [one for one in attacked if one.case.attack in WEAK],
        [one for one in attacked if one.case.attack not in WEAK | OF_LIDAR],
        [one for one in attacked if one.case.attack in OF_LIDAR],
    )
    return [
        str(sum(one.robust.kind is not VerdictKind.CLEAN for one in clean)),
        *(str(sum(one.robust.attacked == one.case.attacked for one in group)) for group in groups),
        str(sum(bool(set(one.robust.attacked) - set(one.case.attacked)) for one in attacked)),
    ]


def lasting(scenes: Sequence[Scene], cameras: Sequence[int]) -> str:
    """Series with an incident, by the prior alone, of lights that last in a quarter, half and all of a drive."""
    found = dict.fromkeys(durations.LASTS[1:], 0)
    for drive in drives_of(scenes, cameras, R, prior=True):
        for attack in LASTING:
            for who, cases in drive.attacks.get(attack, {}).items():
                for lasts, chosen in durations.series_of(cases, len(drive.clean)):
                    if lasts in found:
                        tally = Tally()
                        tally.add(drive, chosen, who)
                        found[lasts] += tally["incident"]
    return " ".join(map(str, found.values()))


def kinds(scenes: Sequence[Scene]) -> str:
    """Lights of other kinds whose camera is named: in one frame of a drive, and in the midst of two seconds."""
    alone = [one for one in judge_all(scenes, FOUR, R) if one.case.attack]
    held = held_light.held(scenes, FOUR, R, {HELD: held_light.LASTING[HELD]})
    named = sum(verdict.attacked == who for _, _, who, verdict in held)
    return f"{sum(one.robust.attacked == one.case.attacked for one in alone)} {named}"


def streets(scenes: Sequence[Scene]) -> list[str]:
    """Frames raised, incidents and alerts of clean streets, each by the others, with four and with three cameras."""
    told = []
    for cameras in (FOUR, THREE):
        raised = incidents = alerts = 0
        for drive in drives_of(scenes, cameras, R):
            verdicts = drive.judged(drive.series({}, MEASURED_HZ))
            raised += sum(one.kind is not VerdictKind.CLEAN for one in verdicts)
            findings = [one.finding for one in verdicts if one.finding is not None]
            incidents += any(not one.alert for one in findings)
            alerts += any(one.alert for one in findings)
        told.append(f"{raised} {incidents} {alerts}")
    return told


def benign(folder: Path) -> str:
    """Frames under faults that are called attacked, that are not clean, and whose cause is right."""
    drives: list[Drive] = [kept_drive(path, dict) for path in sorted(folder.glob("*.series"))]
    count = dict.fromkeys(("attacked", "not clean", "right cause"), 0)
    for drive in drives:
        learnt = learn(calibrated_by(drive, drives, ()), drive.rig, R, ())
        for one in drive.series:
            for verdict in judged(one.frames, learnt, drive.rig) if one.name != CLEAN else ():
                of = outcome(verdict, one.cause, one.sensor)
                for key in count:
                    count[key] += of[key]
    return " ".join(map(str, count.values()))


@contextmanager
def left_out(rule: Rule) -> Iterator[None]:
    """The judge without a rule."""
    with ExitStack() as stack:
        rule.without(stack)
        yield


def _row(name: str, options: argparse.Namespace) -> str:
    rule = next(rule for rule in rules() if rule.name == name)
    scenes = load(options.real)
    with left_out(rule):
        cells = [*single_frames(scenes), lasting(scenes, FOUR), lasting(scenes, THREE)]
        cells += [kinds(load(options.kinds)), *streets(load(options.streets))]
        cells += [benign(folder) for folder in options.faults]
    return " | ".join(["", rule.name, *cells, ""]).strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("real", type=Path, help="attacked real scenes")
    parser.add_argument("--kinds", type=Path, required=True, help="a folder of attack_kinds")
    parser.add_argument("--streets", type=Path, required=True, help="clean streets")
    parser.add_argument("--faults", type=Path, nargs="*", default=[], help="folders of benign and causes")
    parser.add_argument("--since", default="", help="rules from the one with this word on")
    options = parser.parse_args()
    names = [rule.name for rule in rules()]
    first = next(place for place, name in enumerate(names) if options.since in name)
    for name in names[first:]:
        with _FORK.Pool(1) as pool:  # nothing that a rule's absence left behind reaches the next
            print(pool.apply(_row, (name, options)), flush=True)


if __name__ == "__main__":
    main()

"""How much of a calibration one log, vehicle, day or place may be."""

from collections import Counter
from collections.abc import Hashable, Iterator, Sequence, Set
from dataclasses import replace
from decimal import Decimal

import numpy as np

from auditor.identification.refresh_parameters import GATE, INFLUENCE
from auditor.identification.refreshing.drives import Drive, DriveSource
from auditor.identification.refreshing.gate import Step, allowed, steps
from auditor.identification.scores import CleanDrives
from auditor.identification.systems import System

Cell = tuple[int, int]


def limited(sources: Sequence[DriveSource], waiting: Sequence[DriveSource] = ()) -> Iterator[tuple[int, str]]:
    """The places in `sources` of the drives that are too many, each with the reason; later days go first.

    A calibration has so many drives at most, and so many of a vehicle's day, with those that are `waiting` for a
    person: who brings many of a day, of which some are raised, does not get in the others one after the other. No
    vehicle and no day has more than its share of them, where there are three.
    """
    order = sorted(range(len(sources)), key=lambda place: (str(sources[place].day or ""), -place), reverse=True)
    of_day: Counter[Hashable] = Counter(map(_of_a_day, waiting))
    left = []
    for place in order:
        key = _of_a_day(sources[place])
        of_day[key] += 1
        if of_day[key] > INFLUENCE.most_of_a_day:
            yield place, f"its vehicle has {INFLUENCE.most_of_a_day} others of that day"
        else:
            left.append(place)
    too_many = dict(_beyond_share(left, [one.vehicle for one in sources], "vehicle"))
    yield from too_many.items()
    left = [place for place in left if place not in too_many]
    too_many = dict(_beyond_share(left, [one.day for one in sources], "day"))
    yield from too_many.items()
    for place in [place for place in left if place not in too_many][INFLUENCE.most_drives :]:
        yield place, f"{INFLUENCE.most_drives} recordings of later days are enough"


def _of_a_day(source: DriveSource) -> Hashable:
    """What the drives of one vehicle and day share."""
    return source.vehicle, source.recording_id if source.day is None else source.day


def crowded(visited: Sequence[Set[Cell]]) -> Iterator[tuple[int, str]]:
    """The places in `visited` of the drives whose road many others drove; earlier ones of the sequence go first.

    Each entry holds the cells of the ground that a drive was in; one that is empty is not known, and is no reason.
    """
    taken: list[Set[Cell]] = []
    for place, cells in enumerate(visited):
        same = sum(len(cells & other) >= INFLUENCE.same_place * len(cells) for other in taken) if cells else 0
        if same >= INFLUENCE.most_of_a_place:
            yield place, f"{same} others drove the same road"
        else:
            taken.append(cells)


def influential(drives: Sequence[Drive], new: Sequence[int], system: System, r: Decimal) -> dict[int, str]:
    """The new drives, places in `drives`, that alone, or with those of their vehicle or day, raise a threshold far.

    That is further than a refresh may: what one drive, vehicle or day shows and no other is for a person to look at.
    """
    every = CleanDrives.of([one.clean for one in drives], system.sensor_checks, fitted_on=system.fitted_on)
    with_all = every.thresholds(system.judged_together, r)
    for owner in ("recording_id", "vehicle", "day"):
        reasons: dict[int, str] = {}
        of = [getattr(one.source, owner) for one in drives]
        for who in dict.fromkeys(of[place] for place in new if of[place] is not None):
            others = np.array([other != who for other in of], dtype=np.bool_)
            without = replace(with_all, expected=every.expected(others))
            step = steps(without, with_all, system)[0]
            if others.any() and step.rise > allowed(GATE.most_step, int(np.count_nonzero(others))):
                reason = f"{'it' if owner == 'recording_id' else f'its {owner}'} alone would raise {_threshold(step)}"
                reasons |= {place: reason for place in new if of[place] == who}
        if reasons:  # without these drives the others of their vehicle and day may have none
            return reasons
    return {}


def _threshold(step: Step) -> str:
    name = step.check.check.value.replace("_", " ")
    return f"the threshold of {name} of S_{step.check.sensor} by {step.rise:.1f} deviations"


def _beyond_share(order: Sequence[int], of: Sequence[Hashable], owner: str) -> Iterator[tuple[int, str]]:
    """The drives beyond the share of their vehicle or day, where there are three; what is not known has no limit.

    The share is reckoned from the drives of the others: nobody raises it by more drives of their own.
    """
    share, count = INFLUENCE.share, Counter(of[place] for place in order)
    taken: Counter[Hashable] = Counter()
    for place in order:
        most = max(1, int((len(order) - count[of[place]]) * share / (1 - share)))
        taken[of[place]] += 1
        if len(count) > 2 and of[place] is not None and taken[of[place]] > most:
            yield place, f"its {owner} has {most} others, and no {owner} has more than its share"

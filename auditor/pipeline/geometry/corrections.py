"""A calibration that is corrected within a recording, or contradicted: the one that images and points fit is taken.

Two nodes may publish one place in tf, a robot's description and a calibration, one of them seconds later. Nothing moved
then: the rig that fits is in force also while the other one is said to be.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

from auditor.measurement.warning_parameters import GEOMETRY_FIT
from auditor.pipeline.geometry.candidates import best_of, candidate_of
from auditor.recordings import Recording, RigInForce, RigsInForce
from auditor.recordings.rigs.changes import Stretch


def with_fitting_rigs(recording: Recording, rigs: RigsInForce) -> RigsInForce:
    """The rigs; one whose own frames fit another of the same sensors, and not it, leaves them to that one, and is told.

    A rig is compared with the one before it, the first with the one behind it.
    """
    lines: dict[frozenset[str], list[RigInForce]] = {}
    for rig_in_force in rigs.rigs:
        rig = rig_in_force.rig
        lines.setdefault(frozenset(map(rig.topic, rig.sensors)), []).append(rig_in_force)
    none: dict[str, str] = {}
    fitting = [rig_in_force for line in lines.values() for rig_in_force in _fitting(recording, line, none)]
    changes = dict.fromkeys(change._replace(then=none.get(change.what, change.then)) for change in rigs.changes)
    return rigs._replace(rigs=tuple(fitting), changes=tuple(changes))


def _fitting(recording: Recording, line: Sequence[RigInForce], none: dict[str, str]) -> Sequence[RigInForce]:
    """The rigs of the same sensors that keep their frames; `none` gets what becomes of each change that was none."""
    if len(line) == 1:
        return line
    first, *others = line
    if _fits_better(recording, others[0], first):
        others[0] = _also_for(others[0], first)
        none[others[0].since] = "it was taken from the beginning, for so the images and points fit"
        first, *others = others
    kept = [first]
    for later in others:
        if _fits_better(recording, kept[-1], later):
            kept[-1] = _also_for(kept[-1], later)
            none[later.since] = "the one before it stays in force, for so the images and points fit"
        else:
            kept.append(later)
    return kept


def _fits_better(recording: Recording, other: RigInForce, owner: RigInForce) -> bool:
    """Whether the frames that a rig is in force for fit another one, and are in doubt by it itself."""
    own = candidate_of(recording, owner.survey, owner.rig, owner.stretches)
    if best_of([own])[1] >= GEOMETRY_FIT.in_doubt:
        return False
    chosen, fit = best_of([own, candidate_of(recording, other.survey, other.rig, owner.stretches)])
    return chosen is not own and fit >= GEOMETRY_FIT.fits


def _also_for(rig: RigInForce, other: RigInForce) -> RigInForce:
    """A rig that is in force in the time of another one as well."""
    return replace(rig, stretches=tuple(_joined(chain(rig.stretches, other.stretches))))


def _joined(stretches: Iterable[Stretch]) -> Iterator[Stretch]:
    """The stretches in their order, those together that follow one another."""
    last, *others = sorted(stretches, key=lambda one: (one.from_ns is not None, one.from_ns or 0))
    for stretch in others:
        if (last.until_ns, last.reason) == (stretch.from_ns, stretch.reason):
            last = replace(last, until_ns=stretch.until_ns)
        else:
            yield last
            last = stretch
    yield last

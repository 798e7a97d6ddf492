"""The features of a case of an evaluation that show faults and frozen sensors: the judge needs them too."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan, nan

from auditor.lab.evaluation.attacked_frame import AttackedFrame, InTime
from auditor.lab.evaluation.experiments import AttackCase, Attacks, Experiment
from auditor.measurement.fault_features.collect import FeatureInputs
from auditor.model.checks import Pair
from auditor.model.fault_features import COLUMNS, PairFaultFeatures
from auditor.model.measurement import CASE_BRIGHTNESS, NO_FINGERPRINT, Coverage
from auditor.model.rig import LIDAR
from auditor.store.evaluation_tables import CaseFeatures


@dataclass(frozen=True, eq=False)
class _AttackedFrame:
    """An attacked frame of an interval, prepared by pair for the fault features of the next one."""

    frame: int
    pairs: Mapping[Pair, FeatureInputs | None]


class FeaturesOfCases:
    """Takes the features of cases, frame by frame; inside an interval the frame before was attacked as well.

    Intervals lie within chunks, so that an evaluation that was killed or is done in shares takes the same.
    """

    def __init__(self) -> None:
        self._attacked: dict[object, _AttackedFrame] = {}

    def of(self, now: InTime, experiment: Experiment, draw: int, case: AttackCase) -> CaseFeatures:
        """The features of a case of the frame `now`."""
        attacked_frame, attacks, after = now.attacked_frame, case.attacks, now.after
        pairs = attacked_frame.pairs(experiment.triples(attacked_frame.rig))
        before = self._before(now, experiment, draw, case, pairs)
        fault_features = {pair: attacked_frame.fault_features(pair, attacks, before[pair]) for pair in pairs}
        later = after.pairs(experiment.triples(attacked_frame.rig)) if after and attacks else []
        features_after = {pair: attacked_frame.fault_features_after(pair, attacks, after) for pair in later if after}
        saturated = attacked_frame.saturated_px(attacks, experiment.triples(attacked_frame.rig))
        coverage = [_coverage(attacked_frame, sensor, attacks, saturated) for sensor in attacked_frame.rig.sensors]
        return CaseFeatures(
            present=[sensor in attacked_frame.sensors for sensor in attacked_frame.rig.sensors],
            fingerprint=[_fingerprint(attacked_frame, sensor, attacks) for sensor in attacked_frame.rig.sensors],
            brightness={name: [getattr(one, name) for one in coverage] for name in CASE_BRIGHTNESS},
            fault_features=list(_in_order(attacked_frame, fault_features)),
            fault_features_after=list(_in_order(attacked_frame, features_after)),
            returns=attacked_frame.returns(attacks),
        )

    def _before(
        self, now: InTime, experiment: Experiment, draw: int, case: AttackCase, pairs: Sequence[Pair]
    ) -> Mapping[Pair, FeatureInputs | None]:
        """The frame before, prepared for each pair: it is clean, except inside an interval."""
        if now.before is None:
            inputs: Mapping[Pair, FeatureInputs | None] = dict.fromkeys(pairs)
        else:
            inputs = {pair: now.before.earlier(pair, {}) for pair in pairs}
        if experiment.together == 1:
            return inputs
        key, number = (experiment.name, draw, case.attacked, case.strength), now.attacked_frame.frame.number
        last = self._attacked.get(key)
        if last and now.before and last.frame == now.before.frame.number and _same(last.frame, number, experiment):
            inputs = {**inputs, **{pair: last.pairs.get(pair) for pair in pairs}}
        every = now.attacked_frame.rig.pairs
        self._attacked[key] = _AttackedFrame(
            number, {pair: now.attacked_frame.earlier(pair, case.attacks) for pair in every}
        )
        return inputs


def _same(frame: int, other: int, experiment: Experiment) -> bool:
    """True for two frames of one interval."""
    return frame // experiment.together == other // experiment.together


def _fingerprint(attacked_frame: AttackedFrame, sensor: int, attacks: Attacks) -> int | None:
    fingerprint = attacked_frame.fingerprint(sensor, attacks) if sensor in attacked_frame.sensors else NO_FINGERPRINT
    return None if fingerprint == NO_FINGERPRINT else fingerprint


def _coverage(attacked_frame: AttackedFrame, sensor: int, attacks: Attacks, saturated: Mapping[int, int]) -> Coverage:
    if sensor == LIDAR or sensor not in attacked_frame.sensors:
        return Coverage()
    return replace(attacked_frame.coverage(sensor, attacks), saturated_px=saturated.get(sensor))


def _in_order(
    attacked_frame: AttackedFrame, fault_features: Mapping[Pair, PairFaultFeatures]
) -> Iterator[float | None]:
    """All numbers of all pairs that the rig has matched; NaN becomes None."""
    for pair in attacked_frame.rig.pairs:
        values = fault_features[pair].values if pair in fault_features else [nan] * len(COLUMNS)
        yield from (None if isnan(value) else value for value in values)

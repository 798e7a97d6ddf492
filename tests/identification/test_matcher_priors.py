"""The network that comes with auditor has a prior of its own; other networks have none, and SGBM's stays."""

import json
from dataclasses import replace

import numpy as np
import pytest

from auditor.identification import parameters
from auditor.identification.parameters import (
    OTHERS,
    PSMNET_PRIORS,
    SHIPPED,
    FittedOn,
    fitted_on,
    has_prior,
    judging_digest,
    judging_settings,
)
from auditor.identification.prior import expected, prior_of_check, statistic_at
from auditor.identification.scores import CleanDrives
from auditor.model.calibration import CleanFrames
from auditor.model.checks import Check, SensorCheck
from auditor.model.measurement import procedure_of
from auditor.model.parameters import list_parameters
from auditor.model.rig_kind import ComparedTo


def procedure(matcher: str, **settings: object):
    return procedure_of(matcher, json.dumps(settings), ComparedTo.CAMERAS, measuring="m", synchronising="s")


def test_the_prior_of_psmnet_is_for_the_weights_that_come_with_auditor_as_they_are_used_unasked() -> None:
    assert fitted_on(procedure("psmnet", **SHIPPED)) is FittedOn.PSMNET
    assert has_prior(procedure("psmnet", **SHIPPED))


@pytest.mark.parametrize(
    "other", [{"weights_sha256": "0" * 64}, {"range_px": 96}, {"precision": "fp16"}, {"step": 1}, {"colour": True}]
)
def test_other_weights_and_other_settings_have_no_prior(other: dict[str, object]) -> None:
    known = procedure("psmnet", **{**SHIPPED, **other})
    assert fitted_on(known) is FittedOn.SGBM, "drives teach from there"
    assert not has_prior(known)


def test_other_networks_have_no_prior_and_sgbm_has_its_own() -> None:
    for matcher in ("onnx", "another", "sgbm-full"):
        assert not has_prior(procedure(matcher, **SHIPPED))
    assert has_prior(procedure("sgbm"))
    assert fitted_on(procedure("sgbm", **SHIPPED)) is FittedOn.SGBM


def every_check() -> list[SensorCheck]:
    return [SensorCheck(check, 1, others) for check in Check for others in ((2,), (2, 3), (2, 3, 4))]


def test_what_the_network_s_prior_does_not_name_is_that_of_sgbm_and_nothing_is_narrower() -> None:
    named = {one.name for one in list_parameters(PSMNET_PRIORS)}
    for check in every_check():
        sgbm, psmnet = (prior_of_check(check, one) for one in FittedOn)
        priors = check.check.kind.priors
        name = priors[min(len(check.others), len(priors)) - 1].name
        assert (sgbm != psmnet) == (name in named)
        assert psmnet.tail == sgbm.tail
        assert (psmnet.within >= sgbm.within, psmnet.between >= sgbm.between) == (True, True)
    assert set(OTHERS[FittedOn.PSMNET]) == named


def test_drives_teach_from_the_prior_of_their_matcher() -> None:
    check = SensorCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, (2, 3))
    prior = prior_of_check(check, FittedOn.PSMNET)
    usual = np.full(8, statistic_at(prior.mean))
    drive = CleanFrames("a", np.arange(8), {}, {check: usual}, {})
    sgbm, psmnet = (
        CleanDrives.of([drive], [check], fitted_on=one).expected(np.ones(1, bool))[check] for one in FittedOn
    )
    assert psmnet.mean == pytest.approx(prior.mean)
    assert sgbm.mean < psmnet.mean - 0.1


def test_a_value_of_the_network_s_prior_changes_its_rules_and_not_those_of_sgbm(monkeypatch) -> None:
    before = [judging_digest(one) for one in FittedOn]
    assert before[0] == judging_digest()
    assert before[0] != before[1]
    assert "psmnet_priors.conflict" in json.loads(judging_settings(FittedOn.PSMNET))
    assert "psmnet_priors.conflict" not in json.loads(judging_settings())
    changed = replace(PSMNET_PRIORS, conflict=(0.0, 1.0, 1.0))
    monkeypatch.setattr(parameters, "PSMNET_PRIORS", changed)
    after = [judging_digest(one) for one in FittedOn]
    assert (after[0] == before[0], after[1] == before[1]) == (True, False)


@pytest.mark.parametrize(
    ("check", "others", "mean", "deviation"),
    [
        (Check.ADDED_LIGHT, (2, 3), -2.2, 0.914),
        (Check.LIDAR_CONFLICT, (1, 2, 3), -1.4, 0.911),
        (Check.PHOTOMETRIC_INCONSISTENCY, (2,), -0.53, 1.387),
        (Check.PHOTOMETRIC_INCONSISTENCY, (2, 3), -0.87, 1.433),
        (Check.PHOTOMETRIC_INCONSISTENCY, (2, 3, 4), -1.08, 1.563),
        (Check.FALSE_RANGES, (1, 2), -3.88, 1.19),
        (Check.SCATTERED_RANGES, (1, 2), -3.88, 1.187),
    ],
    ids=str,
)
def test_what_the_network_s_prior_expects_of_a_frame_of_a_drive_that_nobody_has_seen(
    check: Check, others: tuple[int, ...], mean: float, deviation: float
) -> None:
    one = SensorCheck(check, 1, others)
    found = expected(prior_of_check(one, FittedOn.PSMNET), ())
    assert (found.mean, found.deviation) == pytest.approx((mean, deviation), abs=6e-4)

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.causes import CameraScores, Nearby, bounds_nearby, of_lens, seen_of
from auditor.identification.faults import fault_hypotheses, fault_scores, faults_of, weigh
from auditor.identification.scores import fault_scale, thresholds_from
from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, NullDistribution, ThetaScale
from auditor.model.checks import CAMERA_CHECKS, Check, sensor_checks_of
from auditor.model.fault_features import COLUMNS, ObservedFeatures
from auditor.model.measurement import BRIGHTNESS
from auditor.model.rig import triples_of
from auditor.model.verdict import Alternative, Cause, Evidence, FaultHypothesis, Verdict, VerdictKind

PAIRS, CAMERAS, SENSORS = ((1, 3), (2, 3)), (1, 2, 3), (0, 1, 2, 3)
FRAMES = 6
JUST_ENOUGH = ThetaScale(1.0, 0.25, 100)
NAN = np.nan
TILTED = {"rotated": 0.7, "rotated_only": 80, "unrotated_only": 30}
STAMPS_NS = np.arange(FRAMES, dtype=np.int64) * 100_000_000
HEALTHY = {
    "row_aligned": 0.9,
    "offset_px": 0.2,
    "offset_share": 0.92,
    "lagged_i": 0.2,
    "lagged_k": 0.2,
    "agreeing": 0.8,
    "bias_px": 0,
    "biased": 0.8,
    "rotated": 0.79,
    "rotated_only": 20,
    "unrotated_only": 60,
    "before_only": 10,
    "now_only": 60,
    "isolated_near": 0.0,
}


def seen(level=90.0, saturated=0.0, red=NAN, blue=NAN, textureless=NAN, **changed):
    """Healthy frames but for some columns: one value for all pairs, or one a pair."""
    columns = {name: np.tile(np.broadcast_to(changed.get(name, HEALTHY[name]), 2), (FRAMES, 1)) for name in COLUMNS}
    columns = {name: values.astype(np.float64) for name, values in columns.items()}
    return ObservedFeatures(PAIRS, columns, CAMERAS, brightness(FRAMES, level, saturated, red, blue, textureless))


def brightness(frames, level, saturated, red=NAN, blue=NAN, textureless=NAN):
    """One value for all cameras, or one a camera."""
    known = {"level": level, "saturated_share": saturated, "red_level": red, "blue_level": blue}
    known["textureless_share"] = textureless
    return {name: np.full((frames, len(CAMERAS)), known.get(name, NAN)) for name in BRIGHTNESS}


def likeliest(**changed):
    """The causes that are as likely as an attack, as (cause, sensor), the likeliest first."""
    scores = fault_scores(seen(**changed), STAMPS_NS, SENSORS)
    causes = fault_hypotheses(scores, dict.fromkeys(scores, JUST_ENOUGH))[FRAMES // 2]
    return [(one.cause, one.sensor) for one in causes if one.score >= 0.5]


def test_a_frame_beside_blurred_ones_is_not_blurred_itself():
    sharp_then_not = seen()
    sharp_then_not.brightness["textureless_share"][:] = 0.4
    sharp_then_not.brightness["textureless_share"][3:, 1] = 0.9
    blurred = fault_scores(sharp_then_not, STAMPS_NS, SENSORS)[Cause.BLURRED, 2]
    assert (blurred[:3] <= 0).all()
    assert (blurred[4:] > 1).all()


def blindness(textured, seconds_apart=0.1):
    """The score of a camera alone that shows these shares of texture, one after another."""
    stamps_ns = (np.arange(len(textured)) * seconds_apart * 1e9).astype(np.int64)
    shown = {name: np.full((len(textured), 1), NAN) for name in BRIGHTNESS}
    shown |= {"textureless_share": 1 - np.array(textured)[:, None], "level": np.full((len(textured), 1), 90.0)}
    columns = {name: np.full((len(textured), 0), NAN) for name in COLUMNS}
    return fault_scores(ObservedFeatures((), columns, (1,), shown), stamps_ns, (0, 1))[Cause.BLIND, 1]


def test_a_lone_camera_is_blind_where_it_shows_hardly_any_of_the_detail_of_seconds_before_or_after():
    sees, blind = 8 * [0.6], 8 * [0.01]
    for dazzled in ([*sees, *blind], [*blind, *sees]):
        score = blindness(dazzled)
        hidden = np.array(dazzled) < 0.1
        assert (score[hidden] > 1).all()
        assert (score[~hidden] <= 0).all()


def test_a_lone_camera_that_shows_less_for_long_is_in_the_dark_and_not_blind():
    assert (blindness(40 * [0.01]) <= 0).all()
    assert (blindness([0.6, *(40 * [0.01])])[27:] <= 0).all()  # from 2.75 s on nothing else is known
    assert (blindness([0.6, 0.2, 0.09]) < 1).all()  # a lorry beside the camera leaves a seventh and more


def test_a_camera_is_blind_where_it_shows_hardly_any_of_the_detail_that_another_one_shows():
    assert (Cause.BLIND, 2) in likeliest(textureless=(0.4, 0.97, 0.5))
    assert {*likeliest(textureless=(0.99, 0.5, 0.99))} >= {(Cause.BLIND, 1), (Cause.BLIND, 3)}  # two of three are
    assert Cause.BLIND not in dict(likeliest(textureless=(0.97, 0.98, 0.99)))  # night
    assert (Cause.BLIND, 2) in likeliest(textureless=(0.4, 0.97, 0.5), level=(90.0, 3.0, 90.0))  # however dark it is


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, []),
        ({"row_aligned": (0.2, 0.9), "offset_share": (0.3, 0.9), "lagged_i": (0.9, 0.2)}, [(Cause.LATE, 1)]),
        ({"row_aligned": 0.2, "offset_share": 0.3, "lagged_k": 0.9}, [(Cause.LATE, 3)]),
        ({"before_only": 60, "now_only": 10}, [(Cause.LATE, 0)]),
        ({"before_only": 30, "now_only": 30}, []),
        ({"before_only": 2, "now_only": 0}, []),
        ({"row_aligned": (0.9, 0.0), "offset_px": (0.2, 12), "offset_share": 0.9}, [(Cause.DISPLACED, 2)]),
        ({"row_aligned": 0.0, "offset_px": -12, "offset_share": 0.9}, [(Cause.DISPLACED, 3)]),
        ({"bias_px": (12, 0), "agreeing": (0.0, 0.8), "biased": 0.8, "rotated": (0.02, 0.79)}, [(Cause.DISPLACED, 1)]),
        ({"rotated_only": 60, "unrotated_only": 20}, [(Cause.DISPLACED, 0)]),
        ({"textureless": (0.4, 0.6, 0.4)}, [(Cause.BLURRED, 2)]),
        ({"textureless": (0.4, 0.5, 0.4)}, []),
        ({"textureless": (0.4, 0.6, 0.6)}, []),
        ({"textureless": (0.4, 0.6, 0.4), "level": (90.0, 75.0, 90.0)}, []),
        ({"rotated_only": (60, 20), "unrotated_only": (20, 60)}, []),
        ({"rotated_only": 2, "unrotated_only": 0}, []),
        ({"rotated_only": 60, "unrotated_only": 20, "bias_px": 5}, []),
        ({"isolated_near": 0.03}, [(Cause.RAIN, 0)]),
        ({"isolated_near": 0.005}, []),
        ({"level": 20.0}, [(Cause.DARK, None)]),
    ],
    ids=lambda value: str(value)[:40],
)
def test_each_fault_follows_from_its_features(changed, expected):
    assert likeliest(**changed) == expected


@pytest.mark.parametrize(
    ("cause", "sensor", "changed", "expected"),
    [
        # A camera lags: more points are row-aligned with the frame before than now, as they are or with one offset.
        (Cause.LATE, 1, {"lagged_i": (0.97, 0.2)}, 0.05 / 0.1),
        (Cause.LATE, 1, {"lagged_i": (0.97, 0.2), "row_aligned": 0.95}, 0.02 / 0.1),
        (Cause.LATE, 2, {"lagged_i": (0.97, 0.2)}, -0.72 / 0.1),
        (Cause.LATE, 3, {"lagged_k": (0.97, 0.95)}, 0.03 / 0.1),
        (Cause.LATE, 3, {"lagged_k": (0.97, NAN)}, 0.05 / 0.1),
        # Tilted: rows off by two pixels at least; what other pairs show is taken off.
        (Cause.DISPLACED, 1, {"offset_px": (2.0, 0.2), "row_aligned": (0.5, 0.9)}, 0.42 / 0.35),
        (Cause.DISPLACED, 1, {"offset_px": (-2.0, 0.2), "row_aligned": (0.5, 0.9)}, 0.42 / 0.35),
        (Cause.DISPLACED, 1, {"offset_px": (1.9, 0.2), "row_aligned": (0.5, 0.9)}, 0.0),
        (Cause.DISPLACED, 1, {"offset_px": (2.0, 2.0), "row_aligned": (0.5, 0.82)}, (0.42 - 0.1) / 0.35),
        (Cause.DISPLACED, 2, {"offset_px": (2.0, 0.2), "row_aligned": (0.5, 0.9)}, 0.0),
        (Cause.DISPLACED, 3, {"offset_px": 2.0, "row_aligned": (0.5, 0.6)}, 0.32 / 0.35),
        # Biased: disparities off by three pixels at least.
        (Cause.DISPLACED, 1, {"bias_px": (3.0, 0), "agreeing": (0.5, 0.8)}, 0.3 / 0.25),
        (Cause.DISPLACED, 1, {"bias_px": (-3.0, 0), "agreeing": (0.5, 0.8)}, 0.3 / 0.25),
        (Cause.DISPLACED, 1, {"bias_px": (2.9, 0), "agreeing": (0.5, 0.8)}, 0.0),
        (Cause.DISPLACED, 3, {"bias_px": (3.0, NAN), "agreeing": (0.5, NAN)}, 0.3 / 0.25),
        (Cause.DISPLACED, 3, {"bias_px": (3.0, 2.9), "agreeing": (0.5, 0.5)}, 0.0),
        # Exposure: the logarithm of a camera's level against the median of the others'.
        (Cause.EXPOSURE, 1, {"level": (120.0, 90.0, 90.0)}, np.log(4 / 3) / 0.2),
        (Cause.EXPOSURE, 2, {"level": (120.0, 90.0, 90.0)}, -np.log(4 / 3) / 2 / 0.2),
        (Cause.EXPOSURE, 1, {"level": (0.0, 90.0, 90.0)}, -np.log(90) / 0.2),
        (Cause.EXPOSURE, 1, {"level": (120.0, NAN, 90.0)}, NAN),
        # White balance: the logarithm of red over blue, less the others' median, or less half of a lone other's.
        (Cause.WHITE_BALANCE, 1, {"red": (120.0, 90.0, 90.0), "blue": 90.0}, np.log(4 / 3) / 0.15),
        (Cause.WHITE_BALANCE, 3, {"red": 90.0, "blue": (80.0, 80.0, 96.0)}, -np.log(6 / 5) / 0.15),
        (Cause.WHITE_BALANCE, 1, {"red": (120.0, NAN, 90.0), "blue": (90.0, NAN, 90.0)}, np.log(4 / 3) / 0.15),
        (Cause.WHITE_BALANCE, 3, {"red": (120.0, NAN, 90.0), "blue": (90.0, NAN, 90.0)}, -np.log(4 / 3) / 2 / 0.15),
        (Cause.WHITE_BALANCE, 1, {"red": (120.0, NAN, NAN), "blue": (90.0, NAN, NAN)}, np.log(4 / 3) / 0.15),
        (Cause.WHITE_BALANCE, 2, {"red": (120.0, NAN, 90.0), "blue": (90.0, NAN, 90.0)}, NAN),
        # The LiDAR lags: the excess of points that agree with the frame before, with a pseudo-count of ten.
        (Cause.LATE, 0, {"before_only": 40, "now_only": 10}, 30 / 60 / 0.2),
        (Cause.LATE, 0, {"before_only": (40, 10), "now_only": 10}, 30 / 60 / 2 / 0.2),
        (Cause.LATE, 0, {"before_only": (40, NAN), "now_only": 10}, 30 / 60 / 0.2),
        # The LiDAR is rotated: the least of its pairs, but for those whose own bias does as well.
        (Cause.DISPLACED, 0, {"rotated_only": (60, 50), "unrotated_only": 20}, 30 / 80 / 0.2),
        (Cause.DISPLACED, 0, {"rotated_only": 60, "unrotated_only": 20, "bias_px": 3.0, "biased": 0.79}, 0.0),
        (Cause.DISPLACED, 0, {"rotated_only": 60, "unrotated_only": 20, "bias_px": -3.0, "biased": 0.79}, 0.0),
        (Cause.DISPLACED, 0, {"rotated_only": 60, "unrotated_only": 20, "bias_px": 2.9, "biased": 0.79}, 40 / 90 / 0.2),
        (Cause.DISPLACED, 0, {"rotated_only": 60, "unrotated_only": 20, "bias_px": 3.0, "biased": 0.78}, 40 / 90 / 0.2),
        (
            Cause.DISPLACED,
            0,
            {"rotated_only": 20, "unrotated_only": 60, "bias_px": 3.0, "biased": 0.79},
            -40 / 90 / 0.2,
        ),
        # Rain: isolated points nearby.
        (Cause.RAIN, 0, {"isolated_near": (0.03, 0.01)}, 0.04 / 2 / 0.01),
        # Darkness is that of the brightest camera.
        (Cause.DARK, None, {"level": (20.0, 60.0, 40.0)}, 20 / 40),
        (Cause.DARK, None, {"level": (20.0, NAN, 40.0)}, 40 / 40),
    ],
)
def test_the_score_of_a_fault_is_worked_out_by_hand(cause, sensor, changed, expected):
    found = fault_scores(seen(**changed), STAMPS_NS, SENSORS)[cause, sensor]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_fault_score_is_a_mean_over_half_a_second():
    frames = 41
    columns = {name: np.full((frames, 2), float(HEALTHY[name])) for name in COLUMNS}
    columns["before_only"], columns["now_only"] = np.zeros((2, frames, 2))
    columns["before_only"][20] = 90.0
    stamps_ns = np.arange(frames, dtype=np.int64) * 100_000_000
    lagging = fault_scores(
        ObservedFeatures(PAIRS, columns, CAMERAS, brightness(frames, 60.0, 0.0)), stamps_ns, SENSORS
    )[Cause.LATE, 0]
    assert np.flatnonzero(lagging).tolist() == [18, 19, 20, 21, 22]
    assert lagging[20] == pytest.approx(0.9 / 0.2 / 5)


def test_the_score_of_a_sensor_that_has_turned_is_a_mean_over_five_seconds():
    frames = 141
    columns = {name: np.full((frames, 2), float(HEALTHY[name])) for name in COLUMNS}
    columns["rotated_only"], columns["unrotated_only"] = np.zeros((2, frames, 2))
    columns["rotated_only"][65:75] = 90.0  # an edge beside the road: a second
    stamps_ns = np.arange(frames, dtype=np.int64) * 100_000_000
    turned = fault_scores(ObservedFeatures(PAIRS, columns, CAMERAS, brightness(frames, 60.0, 0.0)), stamps_ns, SENSORS)[
        Cause.DISPLACED, 0
    ]
    assert np.flatnonzero(turned > 1e-9).tolist() == list(range(40, 100))
    assert turned.max() == pytest.approx(0.9 / 0.2 * 10 / 51)


def test_a_rig_without_a_lidar_has_none_of_its_causes():
    found = fault_scores(seen(), STAMPS_NS, (1, 2, 3))
    assert {sensor for _, sensor in found} == {1, 2, 3, None}
    assert set(found) == set(faults_of((1, 2, 3)))
    assert set(fault_scores(seen(), STAMPS_NS, SENSORS)) == set(faults_of(SENSORS))


def test_of_two_cameras_no_exposure_is_known():
    of_two = replace(seen(), cameras=(1, 2), brightness={name: one[:, :2] for name, one in seen().brightness.items()})
    assert not [cause for cause, _ in fault_scores(of_two, STAMPS_NS, (0, 1, 2)) if cause is Cause.EXPOSURE]
    assert not [cause for cause, _ in faults_of((0, 1, 2)) if cause is Cause.EXPOSURE]


def test_causes_are_listed_from_a_score_of_a_fifth_on_the_likeliest_first():
    plain = ThetaScale(0.0, 1.0, 100)
    scores = {
        (Cause.LATE, 1): np.array([-1.8, -1.81, 0.0]),
        (Cause.DARK, None): np.array([-1.8, NAN, 3.0]),
        (Cause.RAIN, 0): np.array([5.0, -2.0, 0.0]),
    }
    hypotheses = fault_hypotheses(scores, dict.fromkeys(scores, plain))
    assert hypotheses[0] == (
        (Cause.RAIN, 0, 1.0),
        (Cause.LATE, 1, pytest.approx(0.2)),
        (Cause.DARK, None, pytest.approx(0.2)),
    )
    assert hypotheses[1] == ()
    assert fault_hypotheses({(Cause.LATE, 1): np.array([-1.8])}, {(Cause.LATE, 1): plain})[0][0].sensor == 1
    assert hypotheses[2] == ((Cause.DARK, None, 1.0), (Cause.LATE, 1, 0.5), (Cause.RAIN, 0, 0.5))


def test_what_was_not_measured_gives_no_hypothesis():
    nothing = dict.fromkeys(COLUMNS, np.nan)
    scores = fault_scores(seen(**nothing), STAMPS_NS, SENSORS)
    [causes] = set(fault_hypotheses(scores, dict.fromkeys(scores, JUST_ENOUGH)))
    assert causes == ()


def test_what_a_rig_has_always_shown_is_not_listed_and_what_came_since_is():
    always = fault_scores(seen(**TILTED), STAMPS_NS, SENSORS)
    tilt = float(always[Cause.DISPLACED, 0][0])
    assert tilt > 2
    scales = {(Cause.DISPLACED, 0): fault_scale(Cause.DISPLACED, NullDistribution(tilt, 0.1, 0.1, 3, 100, 0.0), 3.0)}
    assert not [one for frame in fault_hypotheses(always, scales) for one in frame if one.score >= 0.5]
    since = fault_scores(seen(**{**TILTED, "rotated_only": 300}), STAMPS_NS, SENSORS)
    assert {(s[0].cause, s[0].sensor, s[0].score >= 0.5) for s in fault_hypotheses(since, scales)} == {
        (Cause.DISPLACED, 0, True)
    }
    assert fault_hypotheses(since, {}) == [()] * FRAMES, "a fault of which nothing is expected is not listed"


def test_theta_of_a_fault_is_just_enough_or_what_clean_frames_seldom_exceed():
    assert fault_scale(Cause.LATE, NullDistribution(-6.0, 0.5, 0.5, 2, 20, 0.0), 3.0) == ThetaScale(1.0, 0.25, 2)
    assert fault_scale(Cause.LATE, NullDistribution(2.0, 0.5, 0.5, 2, 20, 0.0), 4.0) == ThetaScale(4.0, 1.0, 2)
    assert fault_scale(Cause.LATE, NullDistribution(2.0, 0.5, 0.5, 2, 20, 0.0), -np.inf) == ThetaScale(2.0, 0.5, 2)


def test_an_exposure_is_unusual_above_and_below_what_is_usual_until_it_dazzles():
    usual = fault_scale(Cause.EXPOSURE, NullDistribution(1.5, 0.5, 0.5, 2, 20, 0.0), 4.0)
    assert usual == ThetaScale(2.0, 0.5, 2, usual=1.5)
    scores = {(Cause.EXPOSURE, 1): np.array([1.5, 3.49, 3.51, -0.51, -0.49])}
    listed = [
        any(one.score >= 0.5 for one in frame) for frame in fault_hypotheses(scores, dict.fromkeys(scores, usual))
    ]
    assert listed == [False, False, True, True, False]
    far = {(Cause.EXPOSURE, 1): np.array([4.0, 4.01, -9.0])}
    assert [bool(frame) for frame in fault_hypotheses(far, dict.fromkeys(far, usual))] == [True, False, True]


def test_the_usual_exposure_is_that_of_the_rigs_own_drives_and_no_prior():
    checks = SYSTEM.sensor_checks
    darker = [CleanFrames(name, STAMPS_NS, {}, {}, {(Cause.EXPOSURE, 1): np.full(FRAMES, -3.0)}) for name in "ab"]
    learnt, prior = (thresholds_from(clean, checks, 10, Decimal("0.01")).causes for clean in (darker, []))
    assert learnt[Cause.EXPOSURE, 1].usual == pytest.approx(-3.0)
    assert learnt[Cause.EXPOSURE, 1].theta < 2.0
    assert (Cause.EXPOSURE, 1) not in prior
    assert (Cause.EXPOSURE, 2) not in learnt
    assert (Cause.LATE, 1) in prior


def test_of_two_colour_cameras_the_one_whose_white_balance_changed_is_told():
    warm = seen(red=(112.0, NAN, 90.0), blue=(72.0, NAN, 90.0))
    as_usual, changed = (
        fault_scores(one, STAMPS_NS, SENSORS) for one in (seen(red=90.0, blue=(90.0, NAN, 90.0)), warm)
    )
    clean = [CleanFrames(name, STAMPS_NS, {}, {}, as_usual) for name in "ab"]
    learnt = thresholds_from(clean, SYSTEM.sensor_checks, 10, Decimal("0.01")).causes
    first = fault_hypotheses(changed, learnt)[0][0]
    assert (first.cause, first.sensor, first.score) == (Cause.WHITE_BALANCE, 1, 1.0)


def test_no_white_balance_is_told_by_drives_measured_before_channels_were_kept():
    as_before = fault_scores(seen(), STAMPS_NS, SENSORS)
    warm = fault_scores(seen(red=112.0, blue=72.0), STAMPS_NS, SENSORS)
    learnt = thresholds_from(
        [CleanFrames("a", STAMPS_NS, {}, {}, as_before)], SYSTEM.sensor_checks, 10, Decimal("0.01")
    ).causes
    for scores in (as_before, warm):
        assert not any(one.cause is Cause.WHITE_BALANCE for frame in fault_hypotheses(scores, learnt) for one in frame)


def test_of_two_certain_causes_the_more_unusual_is_first():
    scores = {(Cause.EXPOSURE, 1): np.array([2.4]), (Cause.EXPOSURE, 2): np.array([-5.0])}
    [found] = fault_hypotheses(scores, dict.fromkeys(scores, ThetaScale(1.0, 0.25, 3, usual=0.0)))
    assert found == ((Cause.EXPOSURE, 2, 1.0), (Cause.EXPOSURE, 1, 1.0))


LIMIT = 3.0


def verdict(kind=VerdictKind.ATTACKED, attacked=(1,), check="photometric_inconsistency", i=1, lead=2.0, **fields):
    return Verdict(kind, "1", attacked, evidence=(Evidence(check, i, None, None, LIMIT + lead),), **fields)


CLEAN = Verdict(VerdictKind.CLEAN, "0")


def test_a_fault_makes_an_attack_suspect_and_a_clean_frame_a_finding():
    lagging = (FaultHypothesis(Cause.LATE, 1, 0.9),)
    for one in (CLEAN, verdict(), verdict(VerdictKind.UNIDENTIFIED, ())):
        weighed = weigh(one, lagging, LIMIT)
        assert (weighed.kind, weighed.attacked, weighed.causes) == (VerdictKind.SUSPECT, (), lagging)
    assert weigh(verdict(), lagging, LIMIT).alternatives == (Alternative((1,), 0.0),), "what it would be without it"


@pytest.mark.parametrize(
    ("lead", "score", "kind"),
    [
        (1.5, 0.75, VerdictKind.SUSPECT),  # z of 1.5, as much as the check leads by
        (1.51, 0.75, VerdictKind.ATTACKED),
        (0.0, 0.5, VerdictKind.SUSPECT),
        (0.0, 0.49, VerdictKind.ATTACKED),
        (9.0, 1.0, VerdictKind.SUSPECT),  # no lead counts for more than 3
        (9.0, 0.99, VerdictKind.ATTACKED),
    ],
)
def test_an_attack_that_leads_by_more_than_a_fault_stays_an_attack(lead, score, kind):
    assert weigh(verdict(lead=lead), (FaultHypothesis(Cause.LATE, 1, score),), LIMIT).kind is kind


@pytest.mark.parametrize(("score", "kind"), [(0.5, VerdictKind.SUSPECT), (0.49, VerdictKind.CLEAN)])
def test_a_fault_is_a_finding_from_a_half_on(score, kind):
    assert weigh(CLEAN, (FaultHypothesis(Cause.LATE, 1, score),), LIMIT).kind is kind


def test_less_likely_causes_are_only_listed():
    faint = (FaultHypothesis(Cause.LATE, 1, 0.3),)
    assert weigh(verdict(), faint, LIMIT) == verdict(causes=faint)
    assert weigh(CLEAN, faint, LIMIT) == CLEAN


DIRT = CameraScores(added=1.0, removed=5.5, inconsistent=3.5, darker=5.0, saturated_px=5.0, coloured=0.0)
DROP = CameraScores(added=5.0, removed=3.5, inconsistent=3.0, darker=0.5, saturated_px=0.0, coloured=0.0)
GLARE = CameraScores(added=5.0, removed=1.5, inconsistent=0.0, darker=0.15, saturated_px=3.0, coloured=0.0)
FACULA = CameraScores(added=6.0, removed=0.5, inconsistent=3.0, darker=0.08, saturated_px=900.0, coloured=0.0)


@pytest.mark.parametrize(
    ("seen", "cause"),
    [
        (DIRT, Cause.SOILED),
        (DROP, Cause.SOILED),
        (GLARE, Cause.GLARE),
        (GLARE._replace(inconsistent=1.0), Cause.SOILED),
        (FACULA, None),
        (DROP._replace(saturated_px=2000.0), None),
        (DROP._replace(texture=6.5), Cause.SOILED),
        (DROP._replace(texture=7.5), None),
        (CameraScores(NAN, NAN, NAN, NAN), None),
    ],
    ids=[
        "mud",
        "drop",
        "glare",
        "another view",
        "facula",
        "it outshines the scene",
        "texture",
        "speckle",
        "nothing is known",
    ],
)
def test_a_lens_explains_what_it_makes_likelier_than_light_that_was_thrown_in(seen, cause):
    found = of_lens({1: seen})
    assert [(one.cause, one.sensor) for one in found] == ([] if cause is None else [(cause, 1)])
    assert all(0.5 <= one.score < 1 for one in found)
    weighed = weigh(verdict(lead=9.0), (), LIMIT, {1: seen})
    assert weighed.kind is (VerdictKind.ATTACKED if cause is None else VerdictKind.SUSPECT)


@pytest.mark.parametrize(
    ("known", "values", "per_cent"),
    [
        ("removed", np.arange(-0.5, 6), [5.8, 14.7, 30.8, 46.6, 57.7, 64.3, 69.1]),
        ("inconsistent", np.arange(-0.5, 6), [48.5, 51.9, 52.2, 46.5, 35.2, 23.5, 14.7]),
        ("darker", [0.07, 0.16, 0.29, 0.47, 0.78, 1.28, 2.12], [24.8, 31.1, 33.1, 32.6, 34.8, 43.9, 61.5]),
        (
            "saturated_px",
            [0.6, 3.5, 11, 32, 89, 244, 664, 1807],
            [64.5, 64.0, 63.1, 60.0, 53.1, 40.7, 24.5, 11.0],
        ),
    ],
)
def test_what_is_known_of_light_has_the_fitted_chance_of_a_lens(known, values, per_cent):
    nothing = CameraScores(NAN, NAN, NAN, NAN)
    chances = [100 * nothing._replace(**{known: float(value)}).chance_of_lens for value in values]
    np.testing.assert_allclose(chances, per_cent, atol=0.06)


@pytest.mark.parametrize("known", ["removed", "saturated_px"])
def test_the_chance_of_a_lens_rises_with_what_is_removed_and_falls_with_what_saturates(known):
    chances = [DROP._replace(**{known: value}).chance_of_lens for value in (0.0, 2.0, 5.0, 2000.0)]
    assert chances == sorted(chances, reverse=known == "saturated_px")
    assert chances[0] != chances[-1]


def test_what_is_not_known_of_light_says_nothing():
    without = DROP._replace(saturated_px=NAN)
    outshone = DROP._replace(saturated_px=3000.0)
    assert outshone.chance_of_lens < without.chance_of_lens < DROP.chance_of_lens


def test_dirt_explains_only_attacks_on_its_own_camera_however_strong():
    assert weigh(verdict(lead=9.0), (), LIMIT, {2: DIRT}) == verdict(lead=9.0)
    weighed = weigh(verdict(lead=9.0), (), LIMIT, {1: DROP})
    assert (weighed.kind, weighed.causes) == (VerdictKind.SUSPECT, ((Cause.SOILED, 1, DROP.chance_of_lens),))
    assert weigh(CLEAN, (FaultHypothesis(Cause.SOILED, 1),), LIMIT) == CLEAN


def test_a_fault_that_is_a_finding_is_named_before_dirt_and_dirt_before_what_is_less_likely():
    late, toned = FaultHypothesis(Cause.LATE, 1, 0.6), FaultHypothesis(Cause.EXPOSURE, 1, 0.5)
    weighed = weigh(verdict(), (toned, late), LIMIT, {1: DIRT})
    assert weighed.causes == (late, *of_lens({1: DIRT}), toned)


def test_light_of_one_colour_is_no_drop_and_no_exposure():
    assert of_lens({2: DROP._replace(coloured=2.4)}) == of_lens({2: DROP})
    assert of_lens({2: DROP._replace(coloured=2.5), 3: DROP}) == of_lens({3: DROP})
    toned = (FaultHypothesis(Cause.EXPOSURE, 1, 0.9),)
    seen = CameraScores(added=0.49, removed=0.0, inconsistent=0.5, darker=0.5)
    assert weigh(verdict(check="coloured_light"), toned, LIMIT, {1: seen}).kind is VerdictKind.SUSPECT
    lit = seen._replace(coloured=6.0)
    assert weigh(verdict(check="coloured_light"), toned, LIMIT, {1: lit}).kind is VerdictKind.ATTACKED


def test_what_stays_on_a_camera_is_likelier_of_its_lens_and_what_comes_and_goes_is_not():
    lone = DROP.chance_of_lens
    flash = DROP._replace(shown_s=0.0, gone=1.0).chance_of_lens
    steady = DROP._replace(shown_s=3.0, gone=0.0).chance_of_lens
    assert flash < lone < steady
    assert _added_to_ratio(gone=1.0) == pytest.approx(1.5)
    assert _added_to_ratio(shown_s=2.0, gone=0.2) == pytest.approx(0.3 - 1.0)
    assert _added_to_ratio(shown_s=3.0) == pytest.approx(-1.5)
    held_still = FACULA._replace(shown_s=3.0, gone=0.0)
    assert not of_lens({1: held_still}), "a facula of the paper's kind is one however long it is held"


def _added_to_ratio(shown_s: float = 0.0, gone: float = 0.0) -> float:
    alone, nearby = (one.chance_of_lens for one in (DROP, DROP._replace(shown_s=shown_s, gone=gone)))
    return float(np.log(1 / nearby - 1) - np.log(1 / alone - 1))


def test_how_long_a_check_shows_as_much_as_in_a_frame_is_counted_among_the_frames_nearby():
    z = np.array([[4.0, NAN], [2.0, NAN], [1.9, NAN], [NAN, NAN], [4.4, 3.0]])
    assert Nearby(z, span_s=3.0).lasting(0, 4.0) == (2.0, pytest.approx(1 / 3)), "two of three others have half as much"
    assert np.isnan(Nearby(z, span_s=3.0).lasting(1, 3.0)).all(), "no other frame is known"
    assert Nearby(z[[0, 4]], span_s=0.2).lasting(0, 4.0) == (0.2, 0.0), "one other frame is enough"
    assert Nearby(z, span_s=9.0).lasting(0, 4.0) == Nearby(z, span_s=3.0).lasting(0, 4.0), "gaps count for 3 s at most"


def test_nearby_are_the_frames_within_half_of_three_seconds_or_the_next_one_beyond_a_gap():
    stamps_ns = np.array([0.0, 0.1, 0.2, 2.3, 7.3, 12.9, 11.0, 11.1, 11.1]) * 1_000_000_000
    first, end = bounds_nearby(stamps_ns.astype(np.int64), np.array([0, 0, 0, 1, 2, 3, 4, 4, 5]))
    assert list(zip(first.tolist(), end.tolist(), strict=True)) == [
        (0, 3),
        (0, 3),
        (0, 4),  # the next one is 2.1 s later
        (2, 5),  # 5 s are not too long
        (3, 5),  # 5.6 s are too long
        (5, 6),  # the clock was set back
        (6, 8),
        (6, 8),
        (8, 9),  # the clock stood
    ]


def test_light_in_rows_is_no_dirt_and_no_exposure():
    assert of_lens({1: DIRT._replace(striped=2.4), 2: DIRT._replace(striped=2.5)}) == of_lens({1: DIRT})
    toned = (FaultHypothesis(Cause.EXPOSURE, 1, 0.9),)
    seen = CameraScores(added=1.0, removed=0.0, inconsistent=0.5, darker=0.5, striped=6.0)
    assert weigh(verdict(check="striped_light"), toned, LIMIT, {1: seen}).kind is VerdictKind.ATTACKED


SATURATED = CameraScores(added=1.99, removed=0.0, inconsistent=9.0, darker=0.5, saturated_px=2000.0)
BRIGHTER = CameraScores(added=LIMIT + 2.0, removed=0.0, inconsistent=0.99, darker=0.1)


@pytest.mark.parametrize(
    ("seen", "kind"),
    [
        (SATURATED, VerdictKind.SUSPECT),
        (SATURATED._replace(added=2.0), VerdictKind.ATTACKED),
        (SATURATED._replace(unpredicted=2.5), VerdictKind.ATTACKED),
        (SATURATED._replace(unpredicted=2.49), VerdictKind.SUSPECT),
        (BRIGHTER, VerdictKind.SUSPECT),
        (BRIGHTER._replace(inconsistent=1.0), VerdictKind.ATTACKED),
    ],
)
def test_an_exposure_explains_what_saturates_or_what_is_brighter_and_looks_the_same(seen, kind):
    exposure = (FaultHypothesis(Cause.EXPOSURE, 1, 0.5),)
    weighed = weigh(verdict(), exposure, LIMIT, {1: seen})
    assert (weighed.kind, weighed.causes) == (kind, exposure)
    assert weigh(verdict(), exposure, LIMIT).kind is VerdictKind.ATTACKED, "nothing is known of what it shows"


def test_an_exposure_is_listed_where_no_check_fired_and_is_no_finding():
    exposure = (FaultHypothesis(Cause.EXPOSURE, 1, 0.9),)
    assert weigh(CLEAN, exposure, LIMIT) == replace(CLEAN, causes=exposure)


SYSTEM = System(sensor_checks_of(((1, 2), (1, 3), (2, 3)), ((1, 3),), ()), triples_of(3, lidar=True), SENSORS)


LIGHT = {("saturated_px", 1): 12.0, ("saturated_px", 2): 99.0}


def test_what_a_named_camera_shows_is_by_all_cameras_that_are_not_named():
    columns = {(one.check, one.sensor, one.others): n for n, one in enumerate(SYSTEM.sensor_checks)}
    z, statistics = np.zeros((2, len(columns)))
    for others, scores in (((2, 3), (3.0, 4.0, 5.0)), ((3,), (6.0, 7.0, 8.0))):
        for check, score in zip(CAMERA_CHECKS, scores, strict=True):
            z[columns[check, 1, others]], statistics[columns[check, 1, others]] = score, score / 10
    alone, both = (
        replace(CLEAN, kind=VerdictKind.ATTACKED, evidence=tuple(Evidence(*one, None, None, 5.0) for one in found))
        for found in (
            [("removed_light", 1), ("lidar_conflict", 0)],
            [("removed_light", 1), ("added_light", 2), ("lidar_conflict", 0)],
        )
    )
    [(sensor, shown)] = seen_of(alone, z, statistics, SYSTEM, LIGHT).items()
    assert (sensor, shown[:8]) == (1, (3.0, 4.0, 5.0, pytest.approx(0.42 / 0.32), 12, 0, 0, 0))
    assert np.isnan(shown[8:10]).all(), "nothing is known of the frames nearby"
    weaker = 0 * z
    weaker[columns[Check.ADDED_LIGHT, 1, (2, 3)]] = 3.0
    clean = seen_of(alone, z, statistics, SYSTEM, LIGHT, Nearby(np.stack([z, 0 * z, 0.6 * z, weaker]), span_s=0.3))
    assert clean[1][8:10] == pytest.approx((0.1, 2 / 3)), "by the strongest of its checks"
    for check in (Check.UNMATCHED_LIGHT, Check.VEILING_LIGHT, Check.ADDED_TEXTURE):
        lit = z.copy()
        lit[columns[check, 1, (2, 3)]] = 6.0
        assert seen_of(alone, lit, statistics, SYSTEM, LIGHT)[1].unpredicted == 6.0, "one of them is enough"
    assert seen_of(alone, lit, statistics, SYSTEM, LIGHT)[1].texture == 6.0
    light_of_both = seen_of(both, z, statistics, SYSTEM, LIGHT)[1]
    assert light_of_both[:8] == (6.0, 7.0, 8.0, pytest.approx(0.72 / 0.62), 12, 0, 0, 0)
    assert np.isnan(seen_of(alone, z, statistics, SYSTEM, {})[1][4]), "it was measured before light was kept"
    without_3 = replace(alone, out_of_system=(3,))
    assert seen_of(without_3, z, statistics, SYSTEM, {})[1][:3] == (0.0, 0.0, 0.0), "S_2 alone is left"
    unclear = replace(CLEAN, evidence=(Evidence("added_light", 1, None, 2, 5.0),))
    assert seen_of(unclear, z, statistics, SYSTEM, {}) == {}, "of two cameras neither is named"


def test_darkness_is_listed_where_no_check_fired_and_explains_no_light():
    dark = (FaultHypothesis(Cause.DARK, None, 0.9),)
    hypotheses = weigh(CLEAN, dark, LIMIT)
    assert (hypotheses.kind, hypotheses.causes) == (VerdictKind.CLEAN, dark)
    assert weigh(verdict(), dark, LIMIT).kind is VerdictKind.SUSPECT
    for check in ("added_light", "removed_light", "coloured_light"):
        assert weigh(verdict(check=check), dark, LIMIT).kind is VerdictKind.ATTACKED


@pytest.mark.parametrize(
    ("check", "kind"),
    [
        ("lidar_conflict", VerdictKind.SUSPECT),
        ("false_ranges", VerdictKind.SUSPECT),
        ("free_space_conflict", VerdictKind.ATTACKED),
    ],
)
def test_in_the_dark_cameras_alone_name_no_lidar_however_much_they_contradict_it(check, kind):
    dark = (FaultHypothesis(Cause.DARK, None, 0.51),)
    assert weigh(verdict(attacked=(0,), check=check, i=0, lead=5.0), dark, LIMIT).kind is kind


def test_a_frozen_sensor_that_was_left_out_does_not_excuse_the_others():
    frozen = (FaultHypothesis(Cause.FROZEN, 2),)
    weighed = weigh(verdict(out_of_system=(2,)), frozen, LIMIT)
    assert (weighed.kind, weighed.attacked, weighed.causes) == (VerdictKind.ATTACKED, (1,), frozen)
    assert weigh(CLEAN, frozen, LIMIT).kind is VerdictKind.SUSPECT


def test_a_sensor_with_a_fault_explains_only_checks_that_it_can_make_fire():
    rotated = (FaultHypothesis(Cause.DISPLACED, 0, 1.0),)
    camera = verdict(attacked=(2,), i=2)
    assert weigh(camera, rotated, LIMIT) == camera
    lidar = verdict(attacked=(0,), check="lidar_conflict", i=0)
    assert weigh(lidar, rotated, LIMIT).kind is VerdictKind.SUSPECT
    for cause, kind in ((Cause.LATE, VerdictKind.SUSPECT), (Cause.EXPOSURE, VerdictKind.ATTACKED)):
        of_camera = (FaultHypothesis(cause, 2, 1.0),)
        assert weigh(lidar, of_camera, LIMIT).kind is kind, "a camera that lags disagrees with the LiDAR"
    dropout = verdict(attacked=(0,), check="point_dropout", i=0)
    assert weigh(dropout, (FaultHypothesis(Cause.LATE, 2, 1.0),), LIMIT) == dropout
    assert weigh(CLEAN, rotated, LIMIT).kind is VerdictKind.SUSPECT


@pytest.mark.parametrize(("by", "kind"), [(0.1, VerdictKind.SUSPECT), (-0.1, VerdictKind.ATTACKED)])
def test_what_scatters_is_dust_where_nothing_stronger_fired(by, kind):
    found = (
        Evidence("scattered_returns", 0, None, None, LIMIT + 2.0 + by),
        Evidence("false_ranges", 0, None, None, LIMIT + 2.0),
    )
    weighed = weigh(replace(CLEAN, kind=VerdictKind.ATTACKED, attacked=(0,), evidence=found), (), LIMIT)
    assert weighed.kind is kind
    dust = kind is VerdictKind.SUSPECT
    assert weighed.causes == ((FaultHypothesis(Cause.AEROSOL, 0),) if dust else ())
    assert weighed.attacked == (() if dust else (0,))


RAIN = (FaultHypothesis(Cause.RAIN, 0, 1.0),)


def test_rain_is_listed_beside_a_conflict_and_does_not_explain_it():
    found = verdict(attacked=(0,), check="lidar_conflict", i=0, lead=0.0)
    weighed = weigh(found, RAIN, LIMIT)
    assert (weighed.kind, weighed.causes) == (VerdictKind.ATTACKED, RAIN), "a wall in the rain is a wall"


def test_rain_is_listed_where_no_check_fired_and_is_no_finding():
    assert weigh(CLEAN, RAIN, LIMIT) == replace(CLEAN, causes=RAIN)
    assert weigh(CLEAN, (FaultHypothesis(Cause.RAIN, 0, 0.4),), LIMIT) == CLEAN


def test_rain_explains_neither_point_dropout_nor_photometric_inconsistency():
    for check, i in (("point_dropout", 0), ("photometric_inconsistency", 1)):
        identified = verdict(attacked=(i,), check=check, i=i, lead=0.1)
        assert weigh(identified, RAIN, LIMIT) == identified


@pytest.mark.parametrize(("others", "kind"), [(1.0, VerdictKind.SUSPECT), (1.01, VerdictKind.ATTACKED)])
def test_a_fault_explains_a_verdict_of_whose_scores_it_covers_half(others, kind):
    found = (
        Evidence("photometric_inconsistency", 1, None, None, LIMIT + 1.0),
        Evidence("photometric_inconsistency", 2, None, None, LIMIT + others),
    )
    fired = replace(CLEAN, kind=VerdictKind.ATTACKED, attacked=(1, 2), evidence=found)
    assert weigh(fired, (FaultHypothesis(Cause.LATE, 1, 1.0),), LIMIT).kind is kind

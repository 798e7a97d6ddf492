"""The verdict of a frame by itself, and the event that it belongs to."""

from collections import Counter
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.incidents.sequential import incident_limit
from auditor.identification.incidents.series import FrameSeries, Portion
from auditor.identification.prior import statistic_at
from auditor.identification.robust import clean_peaks, judge_frames, judge_portions
from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, NullDistribution, RobustThresholds, ThetaScale
from auditor.model.checks import Check, sensor_checks_of
from auditor.model.rig import triples_of
from auditor.model.verdict import Cause, VerdictKind

PAIRS = ((1, 2), (1, 3), (2, 3))
SYSTEM = System(sensor_checks_of(PAIRS, PAIRS, (3,)), triples_of(3, lidar=True), (0, 1, 2, 3))
LIMIT = 3.0
THRESHOLDS = RobustThresholds(
    "c" * 32,
    Decimal("0.01"),
    LIMIT,
    dict.fromkeys(SYSTEM.sensor_checks, NullDistribution(-2.0, 0.5, 0.5, 3, 100, 0.0)),
    {},
    3,
    incident_limit(),
)
FRAMES = 20


def columns_of(sensor, check):
    return [c for c, one in enumerate(SYSTEM.sensor_checks) if (one.sensor, one.check) == (sensor, check)]


def series_of(hit=(), sensor=1, *, check=Check.ADDED_LIGHT, frozen=(), missing=(), z=6.0):
    """Frames at 10 Hz; in those `hit` a check of one sensor has that score, in those `frozen` S_2 repeats its data."""
    statistics = np.full((FRAMES, len(SYSTEM.sensor_checks)), statistic_at(-2.0))
    statistics[np.ix_(list(hit), columns_of(sensor, check))] = statistic_at(-2.0 + 0.5 * z)
    prints = np.arange(FRAMES)[:, None] * 10 + np.arange(4)
    prints[list(frozen), 2] = -7
    present = np.ones((FRAMES, 4), dtype=np.bool_)
    present[list(missing), 1] = False
    stamps_ns = np.arange(FRAMES, dtype=np.int64) * 100_000_000
    return FrameSeries.of_recording(stamps_ns, statistics, present, prints, {})


@pytest.mark.parametrize(("agreeing", "kind"), [(0.2, VerdictKind.ATTACKED), (0.6, VerdictKind.SUSPECT)])
def test_what_scatters_is_an_aerosol_where_the_cloud_agrees_with_cameras(agreeing, kind):
    series = replace(series_of([7], 0, check=Check.SCATTERED_RANGES), agreeing=np.full(FRAMES, agreeing))
    assert judge_frames(series, SYSTEM, THRESHOLDS, only=[7])[0].kind is kind


LONE = System(sensor_checks_of((), (), (), (1,)), ((0, 1, 1),), (0, 1))


def lone_verdicts(unmatched, *shown):
    """The verdicts on frames of a LiDAR and a lone camera, in which some of its checks have z = 6."""
    values = np.full((FRAMES, len(LONE.sensor_checks)), statistic_at(-2.0))
    values[:, [c for c, one in enumerate(LONE.sensor_checks) if one.check in shown]] = statistic_at(1.0)
    stamps_ns, here = np.arange(FRAMES, dtype=np.int64) * 100_000_000, np.ones((FRAMES, 2), dtype=np.bool_)
    pictures = {("unmatched_share", 1): np.full(FRAMES, unmatched)}
    runs = np.zeros(FRAMES, dtype=np.int64)
    series = FrameSeries(stamps_ns, runs, values, here, ~here, brightness=pictures)
    usual = NullDistribution(-2.0, 0.5, 0.5, 3, 100, 0.0)
    return judge_frames(series, LONE, replace(THRESHOLDS, expected=dict.fromkeys(LONE.sensor_checks, usual)))


def test_a_lone_camera_names_the_lidar_where_its_past_shows_the_rest_of_its_picture():
    assert {v.attacked for v in lone_verdicts(0.3, Check.PARALLAX_CONFLICT)} == {(0,)}
    unnamed = lone_verdicts(0.55, Check.PARALLAX_CONFLICT)
    assert {(v.kind, v.finding.kind) for v in unnamed} == {(VerdictKind.UNIDENTIFIED,) * 2}
    assert "elsewhere" in unnamed[0].reason
    assert unnamed[0].alternatives[0].attacked == (0,)


def test_what_the_lidar_shows_without_pictures_names_it_whatever_they_show():
    by_both = lone_verdicts(0.55, Check.PARALLAX_CONFLICT, Check.FREE_SPACE_CONFLICT)
    assert {v.attacked for v in by_both} == {(0,)}


def judge(*hit, score=None, **what):
    thresholds = THRESHOLDS if score is None else replace(THRESHOLDS, evidence_limit=score)
    return judge_frames(series_of(*hit, **what), SYSTEM, thresholds)


def finding_of(verdict):
    """The kind, the sensors and the number of the event that a frame belongs to; None where to none."""
    return verdict.finding and verdict.finding[:3]


def test_an_attack_that_lasts_is_an_incident_from_its_first_frame_to_its_last():
    verdicts = judge(range(5, 12))
    assert [f for f, v in enumerate(verdicts) if v.kind is VerdictKind.ATTACKED] == list(range(5, 12))
    assert [f for f, v in enumerate(verdicts) if v.in_incident] == list(range(5, 12))
    assert finding_of(verdicts[8]) == (VerdictKind.ATTACKED, (1,), 1)
    assert verdicts[8].finding.added > 0


def test_one_finding_alone_keeps_its_verdict_and_is_no_incident():
    verdicts = judge([7], z=4.0)
    assert verdicts[7].attacked == (1,)
    assert not [v for v in verdicts if v.finding]


def test_one_very_strong_frame_is_told_by_itself_and_is_no_incident():
    [strong] = [v for v in judge([7], z=9.0) if v.finding]
    assert (strong.finding.kind, strong.finding.attacked, strong.finding.alert) == (VerdictKind.ATTACKED, (1,), True)
    assert not strong.in_incident


def test_the_evidence_of_an_incident_must_exceed_the_score():
    series = series_of(range(5, 10))  # too few for a stretch
    peak = max(clean_peaks(series, SYSTEM, THRESHOLDS))
    for score, incident in ((0.99 * peak, True), (1.01 * peak, False)):
        verdicts = judge_frames(series, SYSTEM, replace(THRESHOLDS, evidence_limit=score))
        assert any(v.in_incident for v in verdicts) is incident
        assert verdicts[8].kind is VerdictKind.ATTACKED


def hovering(z, *, check, steady=2.9, begin=40, end=45):
    """Frames at 10 Hz in which a check of S_1 shows a level below the limit, and from `begin` to before `end` more."""
    frames = 80
    at = columns_of(0 if check in (Check.LIDAR_CONFLICT, Check.POINT_DROPOUT) else 1, check)
    values = np.full((frames, len(SYSTEM.sensor_checks)), -2.0)
    values[:, at], values[begin:end, at] = -2.0 + 0.5 * steady, -2.0 + 0.5 * z
    here = np.ones((frames, 4), dtype=np.bool_)
    stamps_ns = np.arange(frames, dtype=np.int64) * 100_000_000
    return FrameSeries(stamps_ns, np.zeros(frames, dtype=np.int64), np.vectorize(statistic_at)(values), here, ~here)


OF_FEW_DRIVES = replace(
    THRESHOLDS, expected=dict.fromkeys(SYSTEM.sensor_checks, NullDistribution(-2.0, 0.5, 0.3, 3, 100, between=0.4))
)
"""The same deviation, most of it between drives: so a level that lasts says little."""


def incident_of(series):
    return [f for f, v in enumerate(judge_frames(series, SYSTEM, OF_FEW_DRIVES)) if v.in_incident]


def test_what_is_constant_below_the_limit_of_a_frame_is_an_incident_once_it_lasts():
    weak = hovering(2.8, check=Check.ADDED_LIGHT, steady=0.0, end=60)
    verdicts = judge_frames(weak, SYSTEM, THRESHOLDS)
    assert {verdict.kind for verdict in verdicts} == {VerdictKind.CLEAN}, "no frame shows it by itself"
    [(held_for, count)] = Counter(finding_of(v) for v in verdicts if v.in_incident).items()
    assert held_for == (VerdictKind.ATTACKED, (1,), 1)
    assert 18 <= count <= 22
    brief = hovering(2.8, check=Check.ADDED_LIGHT, steady=0.0, end=44)
    assert not incident_of(brief)


def test_what_lasts_for_all_of_a_recording_is_an_incident_of_all_its_frames():
    verdicts = judge_frames(hovering(2.8, check=Check.ADDED_LIGHT, begin=0, end=80), SYSTEM, THRESHOLDS)
    assert {finding_of(verdict) for verdict in verdicts} == {(VerdictKind.ATTACKED, (1,), 1)}


@pytest.mark.parametrize("every", [2, 3, 5])
def test_an_attack_of_every_few_frames_is_one_incident_of_these(every):
    verdicts = judge(range(2, 20, every), z=9.0)
    assert [f for f, v in enumerate(verdicts) if v.in_incident] == list(range(2, 20, every))
    assert {v.finding.event for v in verdicts if v.finding} == {1}


def test_an_incident_names_what_most_of_its_evidence_speaks_for():
    series = series_of(range(5, 12), sensor=1, z=9.0)
    series.statistics[8] = series_of([8], sensor=2).statistics[8]
    verdict = judge_frames(series, SYSTEM, THRESHOLDS)[8]
    assert verdict.attacked == (2,)
    assert finding_of(verdict) == (VerdictKind.ATTACKED, (1,), 1)


def test_one_flash_on_another_sensor_does_not_take_the_name_of_an_attack_that_lasts():
    series = series_of(range(5, 15), sensor=1, z=3.6)
    series.statistics[8] = series_of([8], sensor=2, z=12.0).statistics[8]
    verdicts = judge_frames(series, SYSTEM, THRESHOLDS)
    assert {finding_of(verdict)[1] for verdict in verdicts if verdict.in_incident} == {(1,)}


def test_a_sensor_with_frozen_data_is_a_finding_with_its_cause_and_is_left_out():
    verdicts = judge(range(5, 12), 2, frozen=range(4, 14))
    still = verdicts[8]
    assert (still.kind, still.attacked, still.out_of_system) == (VerdictKind.SUSPECT, (), (2,))
    assert [(one.cause, one.sensor) for one in still.causes] == [(Cause.FROZEN, 2)]
    assert finding_of(still) == (VerdictKind.SUSPECT, (), 1)
    assert verdicts[4].kind is VerdictKind.CLEAN, "the first of equal frames repeats nothing yet"


def test_what_a_sensor_repeated_is_no_weak_evidence_of_the_frames_behind():
    verdicts = judge(range(2, 14), 2, frozen=range(1, 14), z=9.0)
    assert [f for f, v in enumerate(verdicts) if v.finding and f >= 14] == []


def test_a_frozen_sensor_has_no_other_cause_and_the_others_keep_theirs():
    late = [(Cause.LATE, 1), (Cause.LATE, 2)]
    series = replace(series_of(frozen=range(4, 14)), fault_scores={cause: np.full(FRAMES, 2.0) for cause in late})
    thresholds = replace(THRESHOLDS, causes=dict.fromkeys(late, ThetaScale(1.0, 0.25, 3)))
    verdicts = judge_frames(series, SYSTEM, thresholds)
    assert [(one.cause, one.sensor) for one in verdicts[8].causes] == [(Cause.FROZEN, 2), (Cause.LATE, 1)]
    assert [(one.cause, one.sensor) for one in verdicts[2].causes] == late


def test_a_missing_sensor_is_neither_checked_nor_named():
    verdicts = judge(range(5, 12), missing=range(5, 12))
    assert {v.kind for v in verdicts} == {VerdictKind.CLEAN}
    assert verdicts[8].out_of_system == (1,)


def test_a_camera_that_only_lacks_light_is_soiled_or_all_others_are_lit_alike():
    verdict = judge(range(5, 12), 1, check=Check.REMOVED_LIGHT)[8]
    assert (verdict.kind, verdict.attacked) == (VerdictKind.SUSPECT, ())
    assert [(one.cause, one.sensor) for one in verdict.causes] == [(Cause.SOILED, 1)]
    assert verdict.alternatives[0].attacked == (2, 3)
    assert finding_of(verdict) == (VerdictKind.SUSPECT, (), 1)


def test_frames_judged_alone_are_judged_as_among_all():
    series = series_of(range(5, 12), frozen=range(9, 14))
    everything = judge_frames(series, SYSTEM, THRESHOLDS)
    assert judge_frames(series, SYSTEM, THRESHOLDS, only=[10, 3]) == [everything[10], everything[3]]
    assert judge_frames(series, SYSTEM, THRESHOLDS, only=[]) == []


def test_a_cause_that_explains_a_frame_makes_it_suspect_unless_causes_are_left_out():
    late = {(Cause.LATE, 1): np.full(FRAMES, 2.0)}
    series = replace(series_of(range(5, 12), z=5.0), fault_scores=late)
    thresholds = replace(THRESHOLDS, causes={(Cause.LATE, 1): ThetaScale(1.0, 0.25, 3)})
    assert finding_of(judge_frames(series, SYSTEM, thresholds)[8]) == (VerdictKind.SUSPECT, (), 1)
    without = judge_frames(series, SYSTEM, thresholds, without_causes=True)
    assert (finding_of(without[8]), without[8].causes) == ((VerdictKind.ATTACKED, (1,), 1), ())


def test_a_blurred_camera_is_a_finding_but_none_beside_light_that_hides_detail():
    blurred = Cause.BLURRED, 1
    series = replace(series_of([8]), fault_scores={blurred: np.full(FRAMES, 2.0)})
    verdicts = judge_frames(series, SYSTEM, replace(THRESHOLDS, causes={blurred: ThetaScale(1.0, 0.25, 3)}))
    assert [(one.cause, one.sensor) for one in verdicts[7].causes] == [blurred]
    assert (verdicts[7].kind, verdicts[8].kind) == (VerdictKind.SUSPECT, VerdictKind.ATTACKED)
    assert blurred not in [(one.cause, one.sensor) for one in verdicts[8].causes]


def test_a_fault_needs_evidence_in_time_as_an_attack_does():
    late = np.zeros(FRAMES)
    thresholds = replace(THRESHOLDS, causes={(Cause.LATE, 1): ThetaScale(1.0, 0.25, 3)})
    for frames, incident in ((range(5, 7), False), (range(5, 18), True)):
        late[list(frames)] = 1.2
        verdicts = judge_frames(replace(series_of(), fault_scores={(Cause.LATE, 1): late}), SYSTEM, thresholds)
        assert [f for f, v in enumerate(verdicts) if v.kind is VerdictKind.SUSPECT] == list(frames)
        assert [f for f, v in enumerate(verdicts) if v.in_incident] == (list(frames) if incident else [])


def test_a_check_of_which_nothing_is_expected_does_not_count():
    thresholds = replace(THRESHOLDS, expected={})
    assert {v.kind for v in judge_frames(series_of(range(5, 12)), SYSTEM, thresholds)} == {VerdictKind.NOT_AUDITABLE}


def test_clean_frames_are_a_series_with_their_missing_and_frozen_sensors():
    nowhere, gone = np.zeros(FRAMES, dtype=np.bool_), np.arange(FRAMES) < 4
    check = SYSTEM.sensor_checks[0]
    clean = CleanFrames(
        "a",
        np.arange(FRAMES, dtype=np.int64) * 100_000_000,
        {},
        {check: np.full(FRAMES, 0.3)},
        {(Cause.LATE, 1): np.zeros(FRAMES)},
        missing={2: gone},
        frozen={3: ~gone},
    )
    series = FrameSeries.of_clean(clean, SYSTEM)
    assert series.present.T.tolist() == [
        (~nowhere).tolist(),
        (~nowhere).tolist(),
        (~gone).tolist(),
        (~nowhere).tolist(),
    ]
    assert series.frozen.T.tolist() == [nowhere.tolist()] * 3 + [(~gone).tolist()]
    assert (series.statistics[:, 0] == 0.3).all()
    assert np.isnan(series.statistics[:, 1:]).all()
    assert set(series.fault_scores) == {(Cause.LATE, 1)}


def weak_and_grey(hit):
    """Light that S_1 has in these frames, and takes away beside it: as a lens might as well as an attacker."""
    added, removed = (
        series_of(hit, check=check, z=z) for check, z in ((Check.ADDED_LIGHT, 5.0), (Check.REMOVED_LIGHT, 1.5))
    )
    return replace(added, statistics=np.maximum(added.statistics, removed.statistics))


def test_light_that_stays_is_of_a_lens_where_the_same_light_in_one_frame_is_thrown_in():
    kinds = [
        {judge_frames(weak_and_grey(hit), SYSTEM, THRESHOLDS)[place].kind for place in hit}
        for hit in ((10,), range(FRAMES))
    ]
    assert kinds == [{VerdictKind.ATTACKED}, {VerdictKind.SUSPECT}]


def test_findings_that_no_incident_holds_are_alerts_in_a_row_or_as_a_tenth_of_the_frames():
    row = judge([7, 8], z=4.0, score=99.0)
    assert [(f, v.finding.alert, v.finding.attacked) for f, v in enumerate(row) if v.finding] == [
        (7, True, (1,)),
        (8, True, (1,)),
    ]
    assert not any(v.in_incident for v in row)
    scattered = judge([3, 9], z=4.0, score=99.0)
    assert [f for f, v in enumerate(scattered) if v.in_alert] == [3, 9], "a tenth of 20 frames"
    assert not [v for v in judge([3], z=4.0, score=99.0) if v.finding], "one of 20 is chance at r = 1 %"


def test_findings_of_one_sensor_make_no_alert_of_another_ones():
    series = series_of([3, 9, 12], z=4.0)
    series.statistics[np.ix_([6], columns_of(3, Check.ADDED_LIGHT))] = statistic_at(0.0)
    verdicts = judge_frames(series, SYSTEM, replace(THRESHOLDS, evidence_limit=99.0))
    assert verdicts[6].attacked == (3,)
    assert [f for f, v in enumerate(verdicts) if v.in_alert] == [3, 9, 12]


@pytest.mark.parametrize(("hit", "told"), [(4, False), (11, True)])
def test_one_finding_that_names_a_sensor_makes_no_alert_with_far_ones_that_name_none(hit, told):
    series = series_of([hit], z=4.0, frozen=range(11, 15))
    verdicts = judge_frames(series, SYSTEM, replace(THRESHOLDS, evidence_limit=99.0))
    assert verdicts[hit].attacked == (1,)
    assert [verdicts[place].in_alert for place in (hit, 12, 13, 14)] == [told, True, True, True]


def test_the_larger_r_is_the_more_findings_an_alert_needs():
    often = replace(THRESHOLDS, r=Decimal("0.2"), evidence_limit=99.0)
    series = series_of([3, 4, 9], z=4.0)
    assert not [v for v in judge_frames(series, SYSTEM, often) if v.finding]
    assert [v for v in judge_frames(series, SYSTEM, replace(often, r=Decimal("0.01"))) if v.in_alert]


def test_sensors_attacked_in_turn_are_named_by_frame_and_no_other_is():
    series = series_of(z=9.0)
    turns = {place: 1 + place % 3 for place in range(4, 16)}
    for place, sensor in turns.items():
        series.statistics[place] = series_of([place], sensor=sensor, z=9.0).statistics[place]
    verdicts = judge_frames(series, SYSTEM, THRESHOLDS)
    named = {place: verdict.finding.attacked for place, verdict in enumerate(verdicts) if verdict.in_incident}
    assert named == {place: (sensor,) for place, sensor in turns.items()}
    assert {verdict.finding.event for verdict in verdicts if verdict.finding} == {1}


@pytest.mark.parametrize("z", [4.0, 9.0])
def test_a_lone_weak_finding_long_before_an_attack_does_not_begin_it(z):
    series = series_of([3], z=z)
    series.statistics[12:18] = series_of(range(12, 18), z=9.0).statistics[12:18]
    held = [place for place, one in enumerate(judge_frames(series, SYSTEM, THRESHOLDS)) if one.in_incident]
    assert held == [*range(12, 18)] if z < 9 else [3, *range(12, 18)], "what is strong counts by itself"


def test_a_lone_weak_finding_long_before_others_does_not_begin_their_alert():
    thresholds = replace(THRESHOLDS, evidence_limit=99.0)
    for first, told in ((2, [15, 16]), (6, [6, 15, 16])):
        verdicts = judge_frames(series_of([first, 15, 16], z=4.0), SYSTEM, thresholds)
        assert [place for place, one in enumerate(verdicts) if one.in_alert] == told


def portions_of(*hit, cut):
    """A series in two portions, as two rigs in turn measure it: that before a place, and that from it on."""
    whole = series_of(hit, z=6.0)
    for part in (slice(0, cut), slice(cut, FRAMES)):
        series = FrameSeries.of_recording(
            whole.stamps_ns[part],
            whole.statistics[part],
            whole.present[part],
            np.arange(FRAMES * 4).reshape(-1, 4)[part],
            {},
        )
        yield Portion(np.arange(FRAMES)[part], series, SYSTEM, THRESHOLDS)


@pytest.mark.parametrize("cut", [7, 9, 10])
def test_a_change_of_the_rig_ends_no_attack(cut):
    whole = judge(range(8, 11))
    first, second = judge_portions(list(portions_of(*range(8, 11), cut=cut)))
    assert [verdict.finding for verdict in (*first, *second)] == [verdict.finding for verdict in whole]
    assert [place for place, verdict in enumerate((*first, *second)) if verdict.in_incident] == [8, 9, 10]


def test_a_frame_in_which_no_data_changed_is_not_auditable_and_says_so():
    whole = series_of()
    prints = np.arange(FRAMES)[:, None] * 10 + np.arange(4)
    prints[5:9] = prints[4]
    series = FrameSeries.of_recording(whole.stamps_ns, whole.statistics, whole.present, prints, {})
    verdicts = judge_frames(series, SYSTEM, THRESHOLDS)
    assert [f for f, v in enumerate(verdicts) if v.kind is VerdictKind.NOT_AUDITABLE] == [5, 6, 7, 8]
    assert verdicts[6].reason == "no sensor's data changed since the frame before"

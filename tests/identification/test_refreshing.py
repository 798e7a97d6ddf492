"""Learning from drives that nobody looked at: who judges whom, who counts, what differs, and what may come in force."""

from collections.abc import Sequence
from datetime import date, timedelta
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.cross_validation import as_scanned, thresholds_of
from auditor.identification.prior import prior_of_check, statistic_at
from auditor.identification.refresh_parameters import CONDITIONS, GATE, INFLUENCE
from auditor.identification.refreshing.drives import Drive, DriveScores, DriveSource, Folds, shown_by, shown_by_others
from auditor.identification.refreshing.gate import (
    VersionComparison,
    compared,
    difference_of,
    doubtful,
    doubts,
    planted_found,
    rates_by_condition,
    share_of,
    worse,
)
from auditor.identification.refreshing.influence import crowded, influential, limited
from auditor.identification.refreshing.two_samples import differing
from auditor.identification.robust import findings_alone, judge_frames
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import Check
from auditor.model.verdict import FINDINGS
from auditor.pipeline.judge import system_of
from tests.making.left_out import leave_one_out_robust
from tests.making.stores import PERIOD_NS, PROCEDURE, make_rig

RIG = make_rig(3)
SYSTEM = system_of(RIG)
FRAMES = 60
R = Decimal("0.01")
DAY = date(2026, 3, 1)


def drawn(
    seed: int,
    *,
    vehicle: str | None = None,
    day: int = 0,
    raised: float = 0.0,
    frames: float = 1.0,
    between: float = 0.3,
) -> Drive:
    """A drive as the prior expects it; `raised` log odds are added to a share of its frames, in checks that vary."""
    rng, statistics = np.random.default_rng(seed), {}
    hit = np.arange(FRAMES) < frames * FRAMES
    for check in SYSTEM.sensor_checks:
        prior = prior_of_check(check)
        odds = rng.normal(rng.normal(prior.mean, between * prior.between), prior.within, FRAMES)
        odds += raised * hit * (check.check is not Check.STRIPED_LIGHT)
        statistics[check] = np.array([statistic_at(one) for one in odds])
    source = DriveSource(f"r{seed}", vehicle or f"v{seed}", DAY + timedelta(days=day))
    return Drive(source, CleanFrames(f"r{seed}", np.arange(FRAMES) * PERIOD_NS, {}, statistics, {}))


@pytest.fixture(scope="module")
def fleet() -> list[Drive]:
    """Twenty-four clean drives of six vehicles and eight days."""
    return [drawn(seed, vehicle=f"v{seed % 6}", day=seed % 8) for seed in range(24)]


def test_a_drive_is_raised_from_more_windows_on_than_clean_ones_have_findings_in_by_chance() -> None:
    assert DriveScores(600, 16, 0, 120, 16, 0).raised(R) == ""
    assert (
        DriveScores(600, 17, 0, 120, 17, 0).raised(R)
        == "17 of 600 frames are findings at r = 0.01: too many for a clean drive"
    )


def test_a_refresh_judges_as_a_scan_does_that_knows_the_drives_own_level(fleet: list[Drive]) -> None:
    odd = drawn(90, raised=0.7)
    thresholds = thresholds_of([one.clean for one in fleet], SYSTEM, R)
    shown = shown_by(odd.clean, SYSTEM, thresholds)
    both = Calibration("c", RIG.kind, PROCEDURE, (*(one.clean for one in fleet), odd.clean))
    by_scan = leave_one_out_robust(both, SYSTEM, R)[-1]
    assert (shown.frames, shown.findings, shown.incidents) == (by_scan.frames, by_scan.findings, by_scan.incidents)


def test_a_drive_is_judged_by_other_vehicles_and_days_then_by_other_vehicles_then_by_other_days() -> None:
    def others(*sources: tuple[str | None, int | None]) -> list[int]:
        known = [DriveSource(f"r{place}", *source) for place, source in enumerate(sources)]
        return Folds(known).others(0)

    assert others(("a", 1), ("a", 2), ("b", 1), ("b", 2)) == [3]
    assert others(("a", 1), ("a", 2), ("b", 1)) == [2]
    assert others(("a", 1), ("a", 2), ("a", 1)) == [1]
    assert others(("a", 1), ("a", 1)) == []
    assert others((None, None), (None, None)) == [1], "what is not known is taken for another vehicle, another day"


def test_no_vehicle_and_no_day_has_more_than_its_share_however_many_drives_it_brings() -> None:
    own = [DriveSource(f"a{day}", "a", day) for day in range(60)]
    others = [DriveSource(f"b{place}", f"b{place}", 100 + place // 3) for place in range(20)]
    left = [place for place in range(80) if place not in dict(limited([*own, *others]))]
    assert sum(place < 60 for place in left) == int(20 * INFLUENCE.share / (1 - INFLUENCE.share))
    flood = [DriveSource(f"f{place}", f"f{place}", 999) for place in range(60)]
    out = dict(limited([*flood, *others]))
    assert sum(place not in out for place in range(60)) == int(20 * INFLUENCE.share / (1 - INFLUENCE.share))
    assert "no day has more than its share" in out[59]


def test_what_waits_counts_among_the_drives_of_its_vehicles_day() -> None:
    flood = [DriveSource(f"f{place}", "bad", 5) for place in range(10)]
    left = INFLUENCE.most_of_a_day - 2
    assert [place for place in range(8) if place not in dict(limited(flood[2:], flood[:2]))] == list(range(left))
    assert not dict(limited([DriveSource("a", "bad", 6), DriveSource("b", "other", 5), DriveSource("c")], flood))


def test_of_one_road_only_some_drives_count_and_unknown_roads_are_no_reason() -> None:
    road, elsewhere = frozenset({(0, x) for x in range(10)}), frozenset({(9, x) for x in range(10)})
    longer = road | {(1, x) for x in range(8)}
    out = dict(crowded([road, road, elsewhere, longer, road, road, road, frozenset(), road]))
    assert list(out) == [6, 8]
    assert out[8] == f"{INFLUENCE.most_of_a_place} others drove the same road"
    assert not dict(crowded([frozenset()] * 20))


def test_drives_of_the_fleet_do_not_differ_and_one_with_another_level_or_shape_does(fleet: list[Drive]) -> None:
    assert not differing(fleet, range(len(fleet)), SYSTEM)
    level, shape = drawn(91, raised=2.0), drawn(92, raised=3.0, frames=0.3)
    found = differing([*fleet, level, shape], [24, 25], SYSTEM)
    assert found.keys() == {24, 25}
    assert "deviations above that of others" in str(found[24])
    assert "scatter otherwise than those of others" in str(found[25])
    assert not differing([*fleet[:7], level], [7], SYSTEM), "seven others say too little"


def test_a_vehicle_does_not_vouch_for_its_own_drives(fleet: list[Drive]) -> None:
    own = [drawn(200 + place, vehicle="bad", day=place, raised=2.0) for place in range(20)]
    assert len(differing([*fleet, *own], range(24, 44), SYSTEM)) == 20


def test_who_alone_would_raise_a_threshold_far_is_left_out_first_by_drive_then_by_vehicle(fleet: list[Drive]) -> None:
    assert not influential(fleet, range(24), SYSTEM, R)
    one = drawn(93, raised=4.0)
    found = influential([*fleet, drawn(94), one], [24, 25], SYSTEM, R)
    assert list(found) == [25]
    assert found[25].startswith("it alone would raise the threshold of ")
    several = [drawn(300 + place, vehicle="bad", day=20 + place, raised=2.0) for place in range(8)]
    found = influential([*fleet, *several], range(24, 32), SYSTEM, R)
    assert found
    assert all(reason.startswith("its vehicle alone") for reason in found.values())


def test_a_step_and_the_loss_of_planted_attacks_may_be_larger_after_few_drives(fleet: list[Drive]) -> None:
    clean = [one.clean for one in fleet]
    higher = [drawn(seed, raised=0.8).clean for seed in range(24)]

    def step(before: Sequence[CleanFrames], after: Sequence[CleanFrames]) -> VersionComparison:
        first, second = (thresholds_of(some, SYSTEM, R) for some in (before, after))
        return compared(clean, SYSTEM, first, second, planted_found(clean, SYSTEM, second))

    same, far = step(clean, clean), step(clean, higher)
    assert not [*doubts(same, same), *worse(same, [], [])]
    reasons = [*doubts(far, far), *worse(far, [], [])]
    assert any("in one refresh" in one for one in reasons)
    assert any("of planted attacks that are found now would be lost" in one for one in reasons)
    assert far.lost.low <= far.lost.value <= far.lost.high
    few = step(clean[:1], higher)
    assert few.rise > GATE.most_step, "which a version of a hundred drives may not"
    assert not any("in one refresh" in one for one in doubts(few, same))


def test_more_raised_windows_of_the_same_new_drives_are_worse() -> None:
    def shown(raised: int) -> DriveScores:
        return DriveScores(600, raised, 0, 120, raised, 0)

    clean = [drawn(1).clean]
    thresholds = thresholds_of(clean, SYSTEM, R)
    same = compared(clean, SYSTEM, thresholds, thresholds, planted_found(clean, SYSTEM, thresholds))
    before = [shown(1) for _ in range(8)]
    assert not list(worse(same, before, before))
    assert "more windows" in next(worse(same, before, [shown(4 + place % 2) for place in range(8)]))


def test_conditions_are_drawn_to_the_share_of_all_and_few_windows_say_nothing() -> None:
    shown = (
        [DriveScores(600, 0, 0, 120, 30, 0)] * 4
        + [DriveScores(600, 0, 0, 120, 0, 0)] * 12
        + [DriveScores(50, 9, 0, 10, 9, 0)]
    )
    weather: list[str | None] = ["rain"] * 4 + [None] * 12 + ["fog"]
    fog, rain = rates_by_condition([{"weather": one} for one in weather], shown)
    assert (rain.value, rain.drives, rain.windows, rain.raised_windows, rain.enough) == ("rain", 4, 480, 120, True)
    assert (fog.value, fog.enough) == ("fog", False)
    of_all = 129 / 1930
    assert of_all < fog.share < 9 / 10
    assert fog.share == pytest.approx((9 + CONDITIONS.windows_of_all * of_all) / (10 + CONDITIONS.windows_of_all))
    assert [reason.split(":")[0] for reason in doubtful([fog, rain], R)] == ["weather rain"]


def test_intervals_are_those_of_drives_and_not_of_their_frames() -> None:
    spread, together = share_of([5] * 20, [100] * 20), share_of([100] + [0] * 19, [100] * 20)
    assert spread.value == together.value == 0.05
    assert together.high - together.low > 3 * (spread.high - spread.low)
    none = share_of([0] * 20, [100] * 20)
    assert none.low == 0.0
    assert none.high == pytest.approx(0.161, abs=0.001)
    lost = difference_of([1, -1, 2, 0], [10, 10, 10, 10])
    assert lost.low < 0 < lost.value == 0.05 < lost.high


def test_each_is_judged_by_others_once_whatever_their_number(fleet: list[Drive]) -> None:
    shown = shown_by_others(fleet, SYSTEM, R)
    assert [one.frames for one in shown] == [FRAMES] * 24
    assert not [one for one in shown if one.raised(R)]


def test_a_drive_without_a_finding_shows_what_judging_each_frame_would_show(fleet: list[Drive]) -> None:
    thresholds = thresholds_of([one.clean for one in fleet[4:]], SYSTEM, R)
    for one in (*fleet[:4], drawn(95, raised=3.0, frames=0.2)):
        series, own = as_scanned(one.clean, thresholds, SYSTEM)
        finding = [verdict.kind in FINDINGS for verdict in judge_frames(series, SYSTEM, own)]
        assert findings_alone(series, SYSTEM, own).tolist() == finding
        assert shown_by(one.clean, SYSTEM, thresholds).findings == sum(finding)

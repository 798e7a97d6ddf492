"""Rain puts drops before what the LiDAR looks at, near it and everywhere, and takes what is far and dark."""

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.attacks.catalogue import ON_LIDAR
from auditor.lab.attacks.faults import Rain
from auditor.lab.attacks.kinds import AttackDraw
from auditor.model.frames import PointCloud
from tests.making.scenes import plane_rig

RIG = plane_rig()
BEAMS = 20_000


def cloud(distance_m, stamp_ns=7):
    """Beams in all directions that end at one distance."""
    rays = np.random.default_rng(0).normal(size=(BEAMS, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return PointCloud(stamp_ns, (rays * distance_m).astype(np.float32))


def ranges_m(points):
    return np.linalg.norm(points.xyz_m, axis=1)


def test_the_same_rain_falls_twice_and_another_at_the_next_moment():
    rain, dry = Rain(10, seed=3), cloud(30)
    first = rain.apply(dry, RIG)
    assert np.array_equal(first.xyz_m, rain.apply(dry, RIG).xyz_m)
    assert first.stamp_ns == 7
    assert not np.array_equal(first.xyz_m, rain.apply(cloud(30, stamp_ns=8), RIG).xyz_m)
    assert not np.array_equal(first.xyz_m, Rain(10, seed=4).apply(dry, RIG).xyz_m)


def test_drops_lie_near_the_sensor_on_its_beams_and_grow_with_the_rain():
    dry = cloud(30)
    shares = []
    for rate in (1, 5, 25, 100):
        wet = Rain(rate, seed=1).apply(dry, RIG)
        distance = ranges_m(wet)
        drops = distance < 20
        assert distance[drops].min() >= 1.5
        assert np.quantile(distance[drops], 0.99) < 9
        assert np.median(distance[drops]) < 4
        assert distance[~drops] == pytest.approx(30, abs=0.5)
        shares.append(drops.mean())
    assert shares == sorted(shares)
    assert 0.01 < shares[0] < 0.04
    assert 0.15 < shares[-1] < 0.35


def test_points_keep_their_order_and_their_directions():
    dry = cloud(10)
    wet = Rain(50, seed=1).apply(dry, RIG)
    assert len(wet.xyz_m) == BEAMS, "nothing so near is too faint"
    before, after = (points.xyz_m / ranges_m(points)[:, None] for points in (dry, wet))
    assert np.allclose(before, after, atol=1e-5)


def test_far_points_are_lost_more_often_in_heavier_rain():
    far = [1 - len(Rain(rate, seed=1).apply(cloud(85), RIG).xyz_m) / BEAMS for rate in (2, 25, 100)]
    assert far == sorted(far)
    assert far[0] < far[-1] / 2
    assert len(Rain(100, seed=1).apply(cloud(10), RIG).xyz_m) == BEAMS


def test_points_nearer_than_any_drop_stay():
    assert ranges_m(Rain(100, seed=1).apply(cloud(1.4), RIG)) == pytest.approx(1.4, abs=0.1)


def test_without_rain_or_without_points_nothing_changes():
    assert np.array_equal(Rain(0, seed=1).apply(cloud(30), RIG).xyz_m, cloud(30).xyz_m)
    empty = PointCloud(7, np.zeros((0, 3), np.float32))
    assert Rain(10, seed=1).apply(empty, RIG).xyz_m.shape == (0, 3)


def test_rain_needs_a_lidar_and_is_drawn_by_its_rate():
    with pytest.raises(SettingError, match="needs a LiDAR"):
        Rain(10, seed=1).apply(cloud(10), plane_rig(lidar=False))
    drawn = ON_LIDAR["rain"](AttackDraw(np.random.default_rng(1), "opaque", 7.5))
    assert (drawn.name, drawn.parameters["rate_mm_h"]) == ("rain", 7.5)

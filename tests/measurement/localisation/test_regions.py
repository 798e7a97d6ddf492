from dataclasses import replace

import cv2
import numpy as np
import pytest

from auditor.measurement import localise, measure
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.localisation.points import solid_around
from auditor.model.frames import PointCloud
from auditor.model.measurement import REGION_STEP
from tests.making.scenes import DEPTH_M, HEIGHT, WIDTH, plane_cloud, plane_rig, scene

RIG = plane_rig()


def regions(frame, sensors):
    _, arrays = measure(frame, RIG, SgbmMatcher())
    return {region.sensor: region for region in localise(arrays, sensors, RIG)}


def covered(region):
    mask = cv2.imdecode(np.frombuffer(region.mask, np.uint8), cv2.IMREAD_GRAYSCALE) > 0
    return mask.repeat(REGION_STEP, 0).repeat(REGION_STEP, 1)[:HEIGHT, :WIDTH]


def overlap(found, truth):
    return (found & truth).sum() / (found | truth).sum()


@pytest.mark.parametrize("sensor", [1, 2, 3])
@pytest.mark.parametrize("light", [120, -120])
def test_what_is_brighter_or_darker_than_all_others_see_is_found(sensor, light):
    frame = scene()
    truth = np.zeros((HEIGHT, WIDTH), dtype=bool)
    truth[32:88, 120:200] = True
    image = frame.images[sensor]
    pixels = np.where(truth, np.clip(image.pixels.astype(int) + light, 0, 255), image.pixels).astype(np.uint8)
    changed = replace(frame, images={**frame.images, sensor: replace(image, pixels=pixels)})
    region = regions(changed, {sensor})[sensor]
    assert overlap(covered(region), truth) > 0.75
    assert region.view == sensor
    assert region.box_px == pytest.approx((120, 32, 200, 88), abs=8)
    assert region.share == pytest.approx(truth.mean(), rel=0.2)
    assert (region.points, region.solid) == (None, None)


def test_a_wall_s_points_and_their_box_are_found():
    cloud = plane_cloud(DEPTH_M)
    inside = np.abs(cloud[:, 1]) < 1.0
    wall = np.where(inside[:, None], cloud * np.float32(5 / DEPTH_M), cloud)
    region = regions(replace(scene(), cloud=PointCloud(0, wall)), {0})[0]
    truth = np.zeros((HEIGHT, WIDTH), dtype=bool)
    truth[:, WIDTH // 2 - 33 : WIDTH // 2 + 34] = True
    assert overlap(covered(region), truth) > 0.9
    assert region.points == pytest.approx(inside.sum(), rel=0.1)
    assert region.solid.centre_m[0] == pytest.approx(5, abs=0.05)
    assert region.solid.centre_m[1] == pytest.approx(0, abs=0.05)
    assert region.solid.size_m[0] == pytest.approx(2 * 5 / DEPTH_M, abs=0.1)
    assert region.solid.size_m[2] < 0.05


def test_no_region_is_localised_where_no_sensor_is_asked_for():
    assert regions(scene(), []) == {}


def test_nothing_is_found_where_nothing_is_wrong():
    assert regions(scene(), RIG.sensors) == {}


def test_only_the_sensors_that_are_asked_for_are_localised():
    frame = scene()
    lit = [frame.images[sensor].pixels.copy() for sensor in (1, 3)]
    for pixels in lit:
        pixels[32:88, 120:200] = 255
    changed = {1: replace(frame.images[1], pixels=lit[0]), 3: replace(frame.images[3], pixels=lit[1])}
    changed = replace(frame, images={**frame.images, **changed})
    assert set(regions(changed, {3})) == {3}
    assert regions(changed, {0}) == {}
    assert {1, 3} <= set(regions(changed, RIG.sensors))


def test_a_sensor_that_is_not_there_has_no_region():
    frame = replace(scene(), cloud=None)
    assert regions(frame, RIG.sensors) == {}


@pytest.mark.parametrize("yaw_deg", [0, 20, -30])
def test_a_box_tells_how_far_it_points_aside(yaw_deg):
    yaw = np.deg2rad(yaw_deg)
    across, along, up = np.meshgrid(np.linspace(-1.5, 1.5, 9), np.linspace(-0.4, 0.4, 5), np.linspace(0, 2, 5))
    # The LiDAR's y points left: what points right of ahead has negative y.
    x = 10 + along * np.cos(yaw) - across * np.sin(yaw)
    y = -(along * np.sin(yaw) + across * np.cos(yaw))
    points = np.stack([x, y, up], axis=-1).reshape(-1, 3).astype(np.float32)
    solid = solid_around(points, RIG)
    assert solid.centre_m == pytest.approx((10, 0, 1), abs=1e-3)
    assert solid.size_m == pytest.approx((3, 2, 0.8), abs=1e-2)
    assert solid.yaw_deg == pytest.approx(yaw_deg, abs=0.1)

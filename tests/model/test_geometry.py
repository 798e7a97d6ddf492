import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auditor.model.optics.geometry import (
    camera_centre,
    compose,
    invert,
    motion,
    quaternion_from_rotation,
    rotation_from_quaternion,
)

part = st.floats(-1, 1)


@given(part, part, part, part)
def test_a_quaternion_survives_the_way_to_a_rotation_and_back(x: float, y: float, z: float, w: float) -> None:
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    if norm < 1e-3:
        return
    rotation = rotation_from_quaternion(x, y, z, w)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation_from_quaternion(*quaternion_from_rotation(rotation)), rotation, atol=1e-9)


def test_a_quarter_turn_about_the_vertical_takes_forward_to_left() -> None:
    rotation = rotation_from_quaternion(0, 0, np.sqrt(0.5), np.sqrt(0.5))
    np.testing.assert_allclose(rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    "quaternion", [(0.0, 0.0, 0.0, 0.0), (float("nan"), 0.0, 0.0, 1.0), (float("inf"), 0.0, 0.0, 1.0)]
)
def test_a_quaternion_without_direction_is_refused(quaternion: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="no rotation"):
        rotation_from_quaternion(*quaternion)


def test_a_motion_and_its_inverse_cancel() -> None:
    a_SE3_b = motion(rotation_from_quaternion(0.1, -0.4, 0.2, 0.9), np.array([1.0, -2.0, 3.0]))
    np.testing.assert_allclose(compose(a_SE3_b, invert(a_SE3_b)), np.eye(4), atol=1e-12)


def test_the_optical_centre_is_the_point_that_projects_nowhere() -> None:
    P = np.array([[721.5, 0, 609.6, 44.86], [0, 721.5, 172.9, 0.216], [0, 0, 1, 0.0027]])
    np.testing.assert_allclose(P @ np.append(camera_centre(P), 1), 0, atol=1e-9)

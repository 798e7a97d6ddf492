import cv2
import numpy as np
import pytest

from auditor.errors import RigError
from auditor.model.optics.geometry import angle_between, intrinsics_and_rotation, rotation_from_quaternion
from auditor.model.optics.sensors import FISHEYE, NO_LENS, PINHOLE, Lens, of_camera

COEFFICIENTS = {
    "plumb_bob": (-0.31, 0.09, 0.0012, -0.0007, -0.01),
    "radtan": (-0.28, 0.07, 0.0002, 0.00002),
    "rational_polynomial": (0.9, -0.2, 0.001, -0.0004, -0.01, 1.2, 0.05, -0.02),
    "equidistant": (-0.013, 0.02, -0.012, 0.002),
}
GRID = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 33), np.linspace(-0.5, 0.5, 21)), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_lenses_bend_as_opencv_says(model: str) -> None:
    rays = np.column_stack([GRID, np.ones(len(GRID))])
    D, still = np.array(COEFFICIENTS[model]), np.zeros(3)
    if model == "equidistant":
        told = cv2.fisheye.distortPoints(GRID[:, None, :], np.eye(3), D)
    else:
        told, _ = cv2.projectPoints(rays, still, still, np.eye(3), D)
    seen = np.column_stack(Lens(model, COEFFICIENTS[model]).distort(*GRID.T))
    assert np.allclose(seen, told.reshape(-1, 2), atol=1e-9)


@pytest.mark.parametrize("model", COEFFICIENTS)
def test_undistorting_takes_distortion_back(model: str) -> None:
    lens = Lens(model, COEFFICIENTS[model])
    back = np.column_stack(lens.undistort(*lens.distort(*GRID.T)))
    assert np.abs(back - GRID).max() < 1e-5


PUBLISHED = {
    "double_sphere": (-0.18, 0.59),
    "omnidirectional": (1.4, -0.21, 0.05, 0.0008, -0.0003),
    "f_theta": (0.0, 930.0, -4.0, -52.0, 21.0, -3.0),
}
K = np.array([[930.0, 0, 640], [0, 930, 400], [0, 0, 1]])


def projected(model: str, D: tuple[float, ...], xyz: np.ndarray) -> np.ndarray:
    """(N, 2) px of points by the papers' own formulas, with K in place of gamma."""
    x, y, z = xyz.T
    if model == "double_sphere":  # Usenko et al., Eq. 40 to 43
        xi, alpha = D
        d1 = np.sqrt(x**2 + y**2 + z**2)
        d2 = np.sqrt(x**2 + y**2 + (xi * d1 + z) ** 2)
        below = alpha * d2 + (1 - alpha) * (xi * d1 + z)
        seen = np.column_stack([x / below, y / below])
    elif model == "omnidirectional":  # Mei and Rives, section II: to the sphere, out of its centre, distortion, K
        xi, k1, k2, p1, p2 = D
        on_sphere = xyz / np.linalg.norm(xyz, axis=1)[:, None]
        mx, my = (on_sphere[:, :2] / (on_sphere[:, 2:] + xi)).T
        rho2 = mx**2 + my**2
        radial = 1 + k1 * rho2 + k2 * rho2**2
        seen = np.column_stack(
            [
                mx * radial + 2 * p1 * mx * my + p2 * (rho2 + 2 * mx**2),
                my * radial + p1 * (rho2 + 2 * my**2) + 2 * p2 * mx * my,
            ]
        )
    else:  # DriveWorks: the distance from the centre in px is a polynomial of the angle
        theta = np.arctan2(np.hypot(x, y), z)
        px = sum(value * theta**power for power, value in enumerate(D))
        return K[:2, 2] + np.column_stack([x, y]) * (px / np.hypot(x, y))[:, None]
    return seen @ K[:2, :2].T + K[:2, 2]


@pytest.mark.parametrize("model", PUBLISHED)
def test_wide_lenses_project_as_their_papers_say(model: str) -> None:
    lens, own_K = of_camera(model, PUBLISHED[model], K)
    wide = 2.5 * GRID[(np.abs(GRID) > 1e-9).any(axis=1)]
    told = projected(model, PUBLISHED[model], 7 * np.column_stack([wide, np.ones(len(wide))]))
    seen = np.column_stack(lens.distort(*wide.T))
    assert np.allclose(seen @ own_K[:2, :2].T + own_K[:2, 2], told, atol=1e-6)
    back = np.column_stack(lens.undistort(*seen.T))
    assert np.abs(back - wide).max() < 1e-4


@pytest.mark.parametrize("model", PUBLISHED)
def test_wide_lenses_show_the_middle_as_a_pinhole_of_their_K(model: str) -> None:
    lens, own_K = of_camera(model, PUBLISHED[model], K)
    x, _ = lens.distort(np.array([1e-5]), np.zeros(1))
    assert x[0] == pytest.approx(1e-5, rel=1e-3)
    coefficients, published_K = lens.as_published(own_K)
    assert np.allclose(coefficients, PUBLISHED[model])
    assert np.allclose(published_K, K)


@pytest.mark.parametrize("given", [(), (1.0, 930.0), (0.0, 0.001, 1e-9), (0.0, 930.0, 1, 1, 1, 1, 1)])
def test_an_f_theta_polynomial_that_is_none_from_angles_to_px_is_refused(given: tuple[float, ...]) -> None:
    with pytest.raises(RigError, match=r"f-theta polynomial|do not fit"):
        of_camera("ftheta", given, K)


def test_rays_behind_the_turning_point_of_a_polynomial_appear_nowhere() -> None:
    lens = Lens("plumb_bob", (-0.3, 0.0, 0.0, 0.0))
    assert lens.reach == pytest.approx(1 / np.sqrt(0.9), abs=0.002)  # the derivative of r - 0.3 r^3 ends there
    x, _ = lens.distort(np.array([0.5, 2.0]), np.zeros(2))
    assert np.isfinite(x).tolist() == [True, False]


def test_coefficients_that_are_all_zero_are_a_pinhole_but_a_fisheye_never_is() -> None:
    assert Lens("plumb_bob", (0.0,) * 5) == Lens("", ()) == Lens() == Lens(PINHOLE)
    assert Lens("fisheye", (0.0,) * 4).model == FISHEYE
    assert Lens("rational_polynomial", (*COEFFICIENTS["rational_polynomial"], *(0.0,) * 6)).coefficients[8:] == ()


@pytest.mark.parametrize(
    ("model", "given"),
    [("omni", (-1.5, 0, 0, 0, 0)), ("ds", (1.0,)), ("plumb_bob", (1.0,)), ("equidistant", (np.nan,) * 4)],
)
def test_a_lens_that_nobody_knows_is_refused(model: str, given: tuple[float, ...]) -> None:
    with pytest.raises(RigError, match="lens"):
        Lens(model, given)


def test_intrinsics_and_rotation_are_found_in_a_full_matrix() -> None:
    K = np.array([[700.0, 0.3, 320], [0, 690, 240], [0, 0, 1]])
    R = rotation_from_quaternion(0.1, -0.7, 0.2, 0.6)
    found_K, found_R = intrinsics_and_rotation(K @ np.column_stack([R, R @ [0.3, -2, 1]]))
    assert np.allclose(found_K, K, atol=1e-9)
    assert np.allclose(found_R, R, atol=1e-12)
    straight_K, straight_R = intrinsics_and_rotation(K @ np.column_stack([np.eye(3), [-0.5, 0, 0]]))
    assert np.array_equal(straight_K, K)  # to the last bit: rigs that are rectified do not change
    assert np.array_equal(straight_R, np.eye(3))


def test_angles_between_directions_are_exact_even_where_they_are_small() -> None:
    assert angle_between(np.array([0, 0, 1.0]), np.array([1e-9, 0, 1])) == pytest.approx(1e-9)
    assert angle_between(np.array([0, 0, 1.0]), np.array([0, 0, -2.0])) == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("name", "like", "size"),
    [
        ("Plumb Bob", "plumb_bob", 5),
        ("plumb-bob", "plumb_bob", 5),
        ("Brown-Conrady", "plumb_bob", 5),
        ("radial-tangential", "plumb_bob", 4),
        ("OPENCV", "plumb_bob", 4),
        ("Rational Polynomial", "rational_polynomial", 8),
        ("rational", "rational_polynomial", 8),
        ("Kannala-Brandt4", "equidistant", 4),
        ("equi", "equidistant", 4),
        ("OPENCV_FISHEYE", "equidistant", 4),
    ],
)
def test_other_names_of_a_model_are_known(name: str, like: str, size: int) -> None:
    coefficients = (-0.2, 0.05, 0.001, 0.0002, 0.01, 0.003, 0.002, 0.001)[:size]
    assert Lens(name, coefficients) == Lens(like, coefficients)


@pytest.mark.parametrize("name", ["pinhole", "Perspective", "rectified", "undistorted", "Inverse Brown Conrady"])
def test_a_lens_that_is_none_has_no_coefficients(name: str) -> None:
    assert Lens(name, (0.0,) * 5) == NO_LENS
    with pytest.raises(RigError, match="do not fit"):
        Lens(name, (0.1, 0, 0, 0, 0))


@pytest.mark.parametrize("name", ["brown", "fov", "eucm"])
def test_models_that_are_others_are_not_taken_for_these(name: str) -> None:
    with pytest.raises(RigError, match="is not known"):
        Lens(name, (0.1, 0, 0, 0))

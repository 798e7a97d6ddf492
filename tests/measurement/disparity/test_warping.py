import numpy as np
import pytest

from auditor.lab.simulation.vehicles import make_rig, rotation
from auditor.measurement.disparity.disparity_error import Comparison
from auditor.measurement.disparity.rectification import rectification
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.disparity.warping import PairToSharedView
from auditor.model.measurement import Counts
from auditor.model.rig import Camera, Rig
from tests.making.scenes import moved

OFFSETS = {
    "above and ahead": ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0)),
    "tilted by 30 degrees": ((0.0, -0.34, 0.0), (0.0, 0.1, 0.05), (0.0, 0.0, 0.0)),
    "far ahead": ((0.0, 0.05, 0.3), (0.0, -0.05, 0.1), (0.0, 0.0, 0.0)),
}
NORMAL = rotation(0.15, 0.1, 0.0)[2]  # of a slanted plane
DISTANCE_M = 9.0


def off_line(name: str) -> Rig:
    return moved(make_rig(3, lidar=True, width_px=621, height_px=188), OFFSETS[name])


def depths(camera: Camera, step: int, axes: np.ndarray) -> np.ndarray:
    """Of a plane 9 m before the first camera, along an ideal camera's own axis, for the pixels of a grid."""
    height, width = -(-camera.height_px // step), -(-camera.width_px // step)
    row, column = np.mgrid[:height, :width]
    pixels = np.stack([(column + 0.5) * step - 0.5, (row + 0.5) * step - 0.5, np.ones(row.shape)])
    rays = np.einsum("ij,jhw->ihw", np.linalg.inv(camera.intrinsics), pixels)
    normal = axes @ NORMAL
    return (DISTANCE_M - normal @ camera.centre_m) / np.einsum("i,ihw->hw", normal, rays)


@pytest.mark.parametrize(("pair", "step"), [((1, 3), 1), ((2, 3), 2)])
@pytest.mark.parametrize("name", list(OFFSETS))
def test_a_warped_disparity_is_f_b_over_z_of_the_common_view(name: str, pair: tuple[int, int], step: int) -> None:
    rig = off_line(name)
    seen = rectification(rig)
    view = seen.pairs[pair]
    own, reference = view.seen.rig.camera(2), seen.rig.camera(pair[1])
    # Rows of the pair's axes in the rig's frame: the LiDAR shows how either is rotated.
    rotation = rig.lidar.rig_SE3_lidar[:3, :3].T
    axes, common = (r.lidar.rig_SE3_lidar[:3, :3] @ rotation for r in (view.seen.rig, seen.rig))
    b = rig.baseline_m(*pair)
    assert view.seen.rig.baseline_m(1, 2) == pytest.approx(b)
    disparity = (own.focal_px * b / depths(own, step, axes)).astype(np.float32)
    everywhere = np.ones(disparity.shape, dtype=np.bool_)
    warped = view.to_shared.stereo(StereoMap(disparity, everywhere, everywhere, step, 128))
    expected = reference.focal_px * b / depths(reference, step, common)
    off_px = np.abs(warped.disparity_px - expected)[warped.valid]
    print(name, pair, f"{warped.valid.mean():.0%} seen, off by {off_px.max():.3f} px at most of {expected.max():.0f}")
    assert warped.valid.mean() > 0.6
    assert off_px.max() < 0.25  # what the next pixel shows, of a plane that is slanted


def test_marks_lie_where_the_reference_view_has_them() -> None:
    rig = off_line("tilted by 30 degrees")
    seen = rectification(rig)
    view = seen.pairs[1, 3]
    at_m = np.array([[x, y, 12.0, 1.0] for x in (-3.0, 0.5, 4.0) for y in (-1.0, 0.8)])
    pixels = []
    for r, camera in ((view.seen.rig, 2), (seen.rig, 3)):
        ideal_SE3_rig = r.lidar.rig_SE3_lidar @ np.linalg.inv(rig.lidar.rig_SE3_lidar)
        u, v, w = r.camera(camera).projection @ ideal_SE3_rig @ at_m.T
        pixels.append(np.rint(np.stack([v / w, u / w]) // 2).astype(int))
    counts = Counts(1, 1, 1, 1, 0)
    back = view.to_shared.comparison(Comparison(counts, *pixels[0], 2))
    assert back.counts is counts
    assert np.abs(np.stack([back.row, back.column]) - pixels[1]).max() <= 1
    outside = view.to_shared.comparison(Comparison(counts, np.array([0]), np.array([0]), 2))
    assert outside.row.size == 0


def test_what_the_pair_does_not_see_is_unknown() -> None:
    near = Camera(1, "near", "/near", 40, 30, np.array([[50.0, 0, 20, 0], [0, 50, 15, 0], [0, 0, 1, 0]]))
    wide = Camera(1, "wide", "/wide", 80, 30, np.array([[50.0, 0, 40, 0], [0, 50, 15, 0], [0, 0, 1, 0]]))
    values = PairToSharedView(near, wide, np.eye(3)).values(np.ones((30, 40), dtype=np.float32), 1)
    assert np.isnan(values[:, :20]).all()
    assert np.isnan(values[:, 60:]).all()
    assert (values[:, 20:60] == 1).all()

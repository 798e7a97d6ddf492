"""LiDAR against stereo, judged again: which inconsistent pixels have an innocent reason."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.comparing import inconsistent
from auditor.evidence.lidar import LidarView
from auditor.evidence.likeness import Likeness
from auditor.evidence.stereo import StereoMap
from auditor.evidence.visibility import visible_to_witness
from auditor.rig import Rig

MOST_ADJUDICATED = 1000
"""Under a strong attack every pixel is inconsistent: of more than this each stride-th stands for its neighbours."""

_RANGE_MARGIN_PX = 3.0
_PASSES_OVER_PX = 3.0
_ALIKE = 0.4
_AS_ALIKE = 0.1
_D0_REACH = 2  # half-resolution half pixels: 0, +-0.5, +-1 around d0 / 2
_DS_REACH = 1

Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LidarElement:
    """E_{0,j,k} pixel by pixel, after adjudication.

    `row` and `column` (M,) are full-resolution pixels of the view's points; `valid` (M,) those that both cameras see,
    with texture and inside the matcher's range; `inconsistent` (M,) those of them that Eq. 2 holds for and nothing
    excuses; `merely_hidden_px` and `alike_px` count the excused ones by reason.
    """

    row: NDArray[np.int32]
    column: NDArray[np.int32]
    valid: Mask
    inconsistent: Mask
    merely_hidden_px: int
    alike_px: int


def adjudicate(view: LidarView, stereo: StereoMap, rig: Rig, witness: int, likeness: Likeness) -> LidarElement:
    """Compare DM_{0,k} at a witness with DM_{j,k}, and excuse what has an innocent reason.

    An inconsistent pixel is excused where the LiDAR's beam passes over the surface that stereo sees (free space), or
    where the pictures are about as much alike at the LiDAR's disparity as at stereo's (appearance).
    """
    d0 = view.disparity_px(rig, witness)
    row, column = view.row // stereo.step, view.column // stereo.step
    ds = stereo.disparity_px[row, column]
    valid = stereo.valid[row, column] & stereo.textured[row, column]
    valid &= (view.u_px - d0 >= 1) & (d0 < stereo.range_px - _RANGE_MARGIN_PX)
    valid &= visible_to_witness(view, rig, witness, d0)
    over = valid & inconsistent(d0, ds)
    flagged = np.flatnonzero(over)
    stride = max(-(-flagged.size // MOST_ADJUDICATED), 1)
    sample = flagged[::stride]
    hidden = _merely_hidden(view, stereo, rig, witness, sample, ds[sample], d0[sample])
    alike = ~hidden
    alike[alike] = _pictures_agree(likeness, view, sample[alike], d0[sample[alike]], ds[sample[alike]])
    # Points lie in row-major order, so those left out are neighbours of the one that stands for them.
    hidden, alike = (reason.repeat(stride)[: flagged.size] for reason in (hidden, alike))
    over[flagged[hidden | alike]] = False
    return LidarElement(view.row, view.column, valid, over, int(hidden.sum()), int(alike.sum()))


def _merely_hidden(
    view: LidarView, stereo: StereoMap, rig: Rig, witness: int, sample: NDArray[np.intp], ds: Floats, d0: Floats
) -> Mask:
    """(S,) mask: where the beam is as far as the stereo surface, that surface lies elsewhere, farther behind.

    Stereo must see something nearer than the LiDAR does (ds > d0); at its depth z_s = f b / ds the beam runs through
    a pixel p' whose own stereo disparity is smaller than ds by more than 3 px.
    """
    assert rig.lidar is not None
    camera = rig.camera(view.reference)
    P = (camera.projection @ rig.lidar.rig_SE3_lidar).astype(np.float32)
    origin, image = P[:, 3], view.point_m[sample] @ P[:, :3].T  # homogeneous pixels of O, and of X - O
    focal_baseline = np.float32(camera.focal_px * rig.baseline_m(witness, view.reference))
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (focal_baseline / ds - origin[2]) / image[:, 2]
        u, v, depth = origin[:, None] + image.T * along
        column, row = np.rint(u / depth / stereo.step), np.rint(v / depth / stereo.step)
    height, width = stereo.disparity_px.shape
    inside = (ds > d0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    there = np.full(sample.size, np.nan, dtype=np.float32)
    there[inside] = stereo.disparity_px[row[inside].astype(np.intp), column[inside].astype(np.intp)]
    return np.asarray(there < ds - np.float32(_PASSES_OVER_PX))


def _pictures_agree(likeness: Likeness, view: LidarView, sample: NDArray[np.intp], d0: Floats, ds: Floats) -> Mask:
    """(S,) mask: the pictures are alike at the LiDAR's disparity, and not clearly more alike at stereo's."""
    row, column = view.row[sample] // 2, view.column[sample] // 2
    n0 = likeness.best(row, column, d0 / 2, _D0_REACH)
    n1 = likeness.best(row, column, ds / 2, _DS_REACH)
    return np.asarray((n0 > _ALIKE) & (n0 > n1 - _AS_ALIKE))

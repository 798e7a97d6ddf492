import numpy as np
import pytest

from auditor.errors import RigError
from auditor.model.optics import common_view as optics
from auditor.model.optics.common_view import IdealView, common_view, compared_shares, compared_views, largest_rectangle
from auditor.model.rig import Camera, Rig


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_rectangle_is_as_large_as_the_best_of_all(seed: int) -> None:
    mask = np.random.default_rng(seed).random((9, 11)) < 0.75
    areas = [
        (bottom - top) * (right - left)
        for top in range(9)
        for bottom in range(top + 1, 10)
        for left in range(11)
        for right in range(left + 1, 12)
        if mask[top:bottom, left:right].all()
    ]
    top, left, rows, columns = largest_rectangle(mask)
    assert mask[top : top + rows, left : left + columns].all()
    assert rows * columns == max(areas)


def test_an_empty_mask_has_none_and_a_full_one_is_all() -> None:
    assert largest_rectangle(np.zeros((4, 5), dtype=np.bool_)) == (0, 0, 0, 0)
    assert largest_rectangle(np.ones((4, 5), dtype=np.bool_)) == (0, 0, 4, 5)


@pytest.mark.parametrize("focal_px", [1e-9, 1e-3, 2.0])
def test_cameras_that_see_next_to_nothing_have_no_view_in_common(focal_px: float) -> None:
    cameras = tuple(
        Camera(
            n,
            f"c{n}",
            f"/c{n}",
            640,
            480,
            np.array([[focal_px, 0, 320, n * focal_px], [0, focal_px, 240, 0], [0, 0, 1, 0]]),
        )
        for n in (1, 2)
    )
    with pytest.raises(RigError, match="no view in common"):
        common_view(Rig(None, cameras))


def test_the_view_of_each_pair_is_found_once_whoever_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Rig] = []

    def counted(rig: Rig, **options: bool) -> IdealView:
        found.append(rig)
        return common_view(rig, **options)

    monkeypatch.setattr(optics, "common_view", counted)
    K = np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]])
    centres = [(-x, y, 0.0) for x, y in ((0, 0), (0.5, 0.3), (1.0, 0))]
    seen_from = [np.column_stack([np.eye(3), np.array(centre)]) for centre in centres]
    cameras = (
        Camera(n, f"c{n}", f"/c{n}", 640, 480, K @ at, rectified=False) for n, at in enumerate(seen_from, start=1)
    )
    rig = Rig(None, tuple(cameras))
    assert [[one.number for one in cameras] for _, cameras in compared_views(rig)] == [[1, 3], [2, 3]]
    assert compared_shares(rig) == {1: 1.0, 2: 1.0, 3: 1.0}
    assert len(found) == len(compared_views(rig)) == 2

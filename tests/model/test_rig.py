from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from auditor.errors import RigError
from auditor.model.rig import Camera, Lidar, Rig, Triple, triples_of
from tests.making.scenes import moved, plane_rig


def camera(number: int, x_m: float, focal_px: float = 700.0) -> Camera:
    P = np.array([[focal_px, 0, 600, -focal_px * x_m], [0, focal_px, 180, 0], [0, 0, 1, 0]], dtype=np.float64)
    return Camera(number, f"camera {number}", f"/camera_{number}/image", 1242, 375, P)


def rig(*positions_m: float, lidar: bool = True) -> Rig:
    cameras = tuple(camera(number, x) for number, x in enumerate(positions_m, start=1))
    return Rig(Lidar("lidar", "/points", np.eye(4)) if lidar else None, cameras)


@pytest.mark.parametrize(
    ("n", "lidar", "count"),
    [(2, True, 1), (3, True, 3), (4, True, 9), (8, True, 83), (3, False, 1), (4, False, 4), (9, False, 84)],
)
def test_a_rig_has_the_triples_of_every_reference(n: int, lidar: bool, count: int) -> None:
    assert len(triples_of(n, lidar=lidar)) == count


def test_triples_are_ordered_from_the_leftmost_reference_down() -> None:
    assert triples_of(3, lidar=True) == ((0, 1, 3), (0, 2, 3), (1, 2, 3))
    assert [triple.k for triple in triples_of(4, lidar=True)] == [4] * 6 + [3] * 3
    assert triples_of(2, lidar=True) == (Triple(0, 1, 2),)
    assert triples_of(3, lidar=False) == (Triple(1, 2, 3),)
    for n in range(3, 7):
        assert set(triples_of(n, lidar=True)) == {Triple(*t) for t in combinations(range(n + 1), 3) if t[2] >= 3}


def test_n_minus_two_sensors_can_be_attacked_at_once_with_a_lidar() -> None:
    assert [rig(*np.linspace(0.6, 0, n)).max_attacked for n in (2, 3, 4, 5)] == [0, 1, 2, 3]
    assert rig(0.6, 0.3, 0.0, lidar=False).max_attacked == 0


def test_cameras_that_do_not_go_from_right_to_left_are_refused_with_their_positions() -> None:
    with pytest.raises(RigError, match=r"camera 1 at x = \+0\.000 m, camera 2 at x = \+0\.600 m"):
        rig(0.0, 0.6)


def test_cameras_must_be_numbered_from_one() -> None:
    with pytest.raises(RigError, match=r"numbered 1\.\.n"):
        Rig(None, (camera(2, 0.5), camera(1, 0.0)))


def test_baselines_are_positive_and_between_any_two_cameras() -> None:
    r = rig(0.54, 0.47, -0.06)
    assert r.baseline_m(1, 3) == pytest.approx(0.60)
    assert r.baseline_m(2, 3) == pytest.approx(0.53)


def test_a_description_reads_back_to_the_same_rig() -> None:
    original = rig(0.54, 1 / 3, -0.06)
    again = Rig.from_dict(original.to_dict())
    assert again.rig_id == original.rig_id
    assert again.cameras[1].projection.tolist() == original.cameras[1].projection.tolist()


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda d: (d.pop("cameras"), d.pop("lidar")), "the rig lacks cameras, which should be a list of tables"),
        (lambda d: d.update(cameras="none"), "cameras of the rig should be a list of tables, but is 'none'"),
        (lambda d: d.update(lidar=3), "lidar of the rig should be a table, but is 3"),
        (lambda d: d["cameras"][0].pop("projection"), "camera 1 lacks projection, which should be 3 x 4 finite"),
        (lambda d: d["cameras"][1].update(projection=[[1, 2], [3, 4]]), "projection of camera 2 should be 3 x 4"),
        (lambda d: d["cameras"][0].update(projection=np.full((3, 4), np.nan).tolist()), "projection of camera 1"),
        (lambda d: d["cameras"][0].update(projection=np.zeros((3, 4)).tolist()), "projection of camera 1 is not K"),
        (lambda d: d["cameras"][0].update(width_px="abc"), "width_px of camera 1 should be a whole number.*'abc'"),
        (lambda d: d["cameras"][0].update(height_px=1.5), "height_px of camera 1 should be a whole number.*1.5"),
        (lambda d: d["cameras"][1].update(rectified="false"), "rectified of camera 2 should be true or false"),
        (lambda d: d["cameras"][1].update(distortion=["x"]), "distortion of camera 2 should be a list of finite numb"),
        (lambda d: d["cameras"][1].update(distortion_model="magic"), "'magic' is not known .distortion of camera 2"),
        (lambda d: d["lidar"].pop("rig_SE3_lidar"), "the LiDAR lacks rig_SE3_lidar, which should be 4 x 4"),
        (lambda d: d["lidar"].update(offset_ns="soon"), "offset_ns of the LiDAR should be a whole number.*'soon'"),
    ],
)
def test_what_a_description_lacks_or_holds_wrongly_is_named(spoil, says: str) -> None:
    description = rig(0.5, 0.0).to_dict()
    spoil(description)
    with pytest.raises(RigError, match=says):
        Rig.from_dict(description)


def test_offsets_are_given_by_sensor_and_change_the_id_only_where_they_are_given() -> None:
    plain = rig(0.54, 0.0)
    cameras = (replace(plain.cameras[0], offset_ns=-8_000_000), plain.cameras[1])
    given = replace(plain, cameras=cameras, lidar=replace(plain.lidar, offset_ns=0))
    assert given.offsets_ns == {0: 0, 1: -8_000_000}
    assert Rig.from_dict(given.to_dict()).offsets_ns == given.offsets_ns
    assert plain.offsets_ns == {}
    assert "offset_ns" not in str(plain.to_dict())
    assert given.rig_id != plain.rig_id


def test_rigs_of_one_model_share_their_kind_although_their_calibration_differs() -> None:
    kind = rig(0.54, 0.47, -0.06).kind
    assert kind.matches(rig(0.545, 0.472, -0.061).kind)  # 5 mm, or 2 %
    assert not kind.matches(rig(0.54, 0.45, -0.06).kind)
    assert not kind.matches(rig(0.54, 0.47, -0.06, lidar=False).kind)
    assert not kind.matches(rig(0.54, 0.47).kind)
    wide = Rig(None, tuple(replace(c, width_px=1920) for c in rig(0.5, 0.0).cameras))
    assert not wide.kind.matches(rig(0.5, 0.0, lidar=False).kind)


def test_a_kind_reads_as_one_line() -> None:
    assert str(rig(0.54, 0.47, -0.06).kind) == "LiDAR + 3 cameras 1242x375 f=700px b=0.07,0.53m"


def test_cameras_share_a_view_that_miss_their_line_by_one_row_at_ten_metres_at_most() -> None:
    def lowered(by_m: float) -> Rig:
        return moved(plane_rig((0.6, 0.3, 0.0)), ((0.0, 0.0, 0.0), (0.0, by_m, 0.0), (0.0, 0.0, 0.0)))

    rows_a_metre = max(lowered(0.01).off_line_px.values()) / 0.01
    assert lowered(0.99 / rows_a_metre).shares_view
    assert not lowered(1.01 / rows_a_metre).shares_view

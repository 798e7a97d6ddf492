import json
import math
from pathlib import Path

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors import Detection, ImageBox, SolidBox, find_detectors
from auditor.lab.evaluation.object_baseline.detectors.geometric import ViewPoints, find_objects
from auditor.lab.evaluation.object_baseline.detectors.overlap import best_partners, overlaps, overlaps_on_ground
from tests.making.detector_models import hostile_models, write_camera_detector, write_cloud_detector, write_detector
from tests.making.scenes import FOCAL, HEIGHT, RIG_SE3_LIDAR, WIDTH, plane_rig

pytest.importorskip("onnxruntime")

BLACK = np.zeros((50, 100, 3), dtype=np.uint8)
POINTS = np.array([[10.0, 0.0, -1.0]], dtype=np.float32)


def camera(path: Path):
    return find_detectors([f"onnx:{path}"]).camera


def cloud(path: Path):
    return find_detectors([f"onnx:{path}"]).cloud


def test_boxes_agree_by_intersection_over_union() -> None:
    a, b, far = ImageBox(0, 0, 10, 10), ImageBox(5, 0, 15, 10), ImageBox(50, 0, 60, 10)
    np.testing.assert_allclose(overlaps([a, b], [a, b, far]), [[1, 1 / 3, 0], [1 / 3, 1, 0]])
    assert overlaps([], [a]).shape == (0, 1)


def test_a_source_camera_sees_an_object_further_to_the_left_by_no_more_than_the_largest_disparity() -> None:
    reference, source = ImageBox(50, 0, 60, 10), ImageBox(20, 0, 30, 10)
    assert overlaps([reference], [source], 40.0) == 1.0
    assert overlaps([reference], [source], 25.0) == pytest.approx(5 / 15)
    assert overlaps([source], [reference], 40.0) == 0.0


def test_footprints_agree_however_they_are_turned() -> None:
    straight = SolidBox(0, 0, 20, 4, 2, 1.5, 0)
    turned = SolidBox(0, 0, 20, 2, 4, 1.5, math.pi / 2)
    beside = SolidBox(2, 0, 20, 4, 2, 1.5, 0)
    np.testing.assert_allclose(overlaps_on_ground([straight], [turned, beside]), [[1, 1 / 3]], atol=1e-5)
    across = SolidBox(0, 0, 20, 4, 2, 1.5, math.pi / 2)
    np.testing.assert_allclose(overlaps_on_ground([straight], [across]), [[1 / 3]], atol=1e-5)


def test_only_objects_that_the_other_could_have_named_need_a_partner() -> None:
    car, tree = Detection(ImageBox(0, 0, 10, 10), label="Car"), Detection(ImageBox(40, 0, 50, 10))
    named = frozenset({"Car"})
    assert best_partners([car], [tree], labels_of_first=named, labels_of_second=None) == ((0.0, 1.0),)
    found = best_partners([car], [car, tree], labels_of_first=None, labels_of_second=None)
    assert [one.iou for one in found] == [1.0, 1.0, 0.0]
    assert best_partners([], [], labels_of_first=None, labels_of_second=None) == ()


@pytest.mark.parametrize(
    ("box", "needs"),
    [
        (ImageBox(20, 20, 60, 60), True),
        (ImageBox(20, 21, 60, 60), False),  # 39 px high
        (ImageBox(2, 20, 60, 60), False),  # at an edge
        (ImageBox(20, 59, 60, 99), False),
        (ImageBox(70, 20, 120, 60), False),  # 2 of 5 hidden behind a lower one
        (ImageBox(50, 20, 110, 60), True),  # 1 of 6 hidden
    ],
)
def test_an_object_that_is_not_plainly_seen_needs_no_partner_but_may_be_one(box: ImageBox, needs: bool) -> None:
    near, other = Detection(ImageBox(100, 20, 170, 70), 0.8), Detection(box, 0.6)
    found = best_partners([near, other], [], size_px=(200, 100))
    assert [one.score for one in found] == ([0.8, 0.6] if needs else [0.8])
    plain = Detection(ImageBox(box.left + 1, box.top - 15, box.right, box.bottom - 2), 0.9)
    partnered = best_partners([plain], [other], size_px=(200, 100))
    assert partnered[0].iou > 0.5  # whatever it needs itself


def view_of(boxes: list[tuple[float, float, float]]) -> ViewPoints:
    """A flat ground 1.6 m under the camera and upright 2 m x 1.5 m plates at (x, depth), seen by dense rays."""
    u, v = (grid.ravel().astype(float) for grid in np.meshgrid(np.arange(0, WIDTH, 2), np.arange(0, HEIGHT, 2)))
    slope = (v - HEIGHT / 2) / FOCAL
    depth = np.where(slope > 0, 1.6 / np.where(slope > 0, slope, 1), np.inf)
    for x, z in boxes:
        y = slope * z
        on = (np.abs((u - WIDTH / 2) / FOCAL * z - x) < 1) & (y < 1.6) & (y > 0.1) & (z < depth)
        depth = np.where(on, z, depth)
    known = np.isfinite(depth)
    return ViewPoints(u[known], v[known], depth[known])


def test_points_above_the_ground_are_objects_and_the_ground_is_not() -> None:
    seen_by = plane_rig().camera(3)
    assert find_objects(view_of([]), seen_by) == ()
    found = sorted(
        (one.box for one in find_objects(view_of([(-2.0, 12.0), (3.0, 20.0)]), seen_by)), key=lambda b: b.left
    )
    expected = [
        ImageBox(WIDTH / 2 + FOCAL * (x - 1) / z, HEIGHT / 2 + FOCAL * 0.1 / z, WIDTH / 2 + FOCAL * (x + 1) / z, 0)
        for x, z in ((-2.0, 12.0), (3.0, 20.0))
    ]
    assert len(found) == 2
    for box, meant in zip(found, expected, strict=True):
        assert (box.left, box.right) == pytest.approx((meant.left, meant.right), abs=4)
        assert box.top == pytest.approx(meant.top, abs=4)


def test_no_points_no_objects() -> None:
    nothing = np.empty(0)
    assert find_objects(ViewPoints(nothing, nothing, nothing), plane_rig().camera(1)) == ()


def test_a_camera_detector_gives_boxes_in_the_images_own_pixels(tmp_path: Path) -> None:
    rows = [[10, 10, 20, 30], [10, 11, 20, 30], [0, 0, 5, 5]]
    found = camera(write_camera_detector(tmp_path / "m.onnx", rows, [0.9, 0.8, 0.1])).detect(BLACK)
    assert found == (Detection(ImageBox(10, 10, 20, 30), pytest.approx(0.9), "Car"),)


@pytest.mark.parametrize(
    ("given", "row"),
    [
        ('format = "yxyx"', [10, 20, 30, 40]),
        ('format = "xywh"', [20, 10, 20, 20]),
        ('format = "cxcywh"', [30, 20, 20, 20]),
        ('format = "xyxy"\nunits = "shares"', [0.2, 0.2, 0.4, 0.6]),
    ],
)
def test_boxes_may_come_in_any_usual_format(tmp_path: Path, given: str, row: list[float]) -> None:
    path = write_camera_detector(tmp_path / "m.onnx", [row], [0.9], given=f'labels = ""\n{given}')
    (found,) = camera(path).detect(BLACK)
    assert [found.box.left, found.box.top, found.box.right, found.box.bottom] == pytest.approx([20, 10, 40, 30])


def test_letterboxed_and_stretched_images_give_boxes_where_the_objects_are(tmp_path: Path) -> None:
    for fit, row in (("stretch", [10, 10, 20, 40]), ("letterbox", [10, 30, 20, 45])):
        taken = f'size = [100, 100]\nfit = "{fit}"'
        (found,) = camera(write_camera_detector(tmp_path / f"{fit}.onnx", [row], [1.9], taken=taken)).detect(BLACK)
        assert (found.box.top, found.box.bottom) == pytest.approx((5, 20))


def test_one_table_of_boxes_objectness_and_classes_is_taken_apart_by_columns(tmp_path: Path) -> None:
    rows = [[0, 0, 10, 10, 0.5, 0.1, 0.1, 0.8], [50, 0, 60, 10, 0.9, 0.1, 0.8, 0.1]]
    given = 'boxes = "boxes[0:4]"\nscores = "boxes[5:8]"\nobjectness = "boxes[4]"\nlabels = ""'
    found = camera(write_camera_detector(tmp_path / "m.onnx", rows, [0], given=given)).detect(BLACK)
    assert [(one.label, round(one.score, 6)) for one in found] == [("Pedestrian", 0.4)]  # the other class has no name


def test_numbers_of_classes_count_from_the_first(tmp_path: Path) -> None:
    path = write_camera_detector(
        tmp_path / "m.onnx", [[0, 0, 9, 9], [20, 0, 29, 9]], [0.9, 0.9], given="", labels=[1, 3]
    )
    path.with_suffix(".toml").write_text(path.with_suffix(".toml").read_text().replace("score =", "first = 1\nscore ="))
    assert [one.label for one in camera(path).detect(BLACK)] == ["Car", "Pedestrian"]


def test_bytes_rows_of_pixels_and_grey_levels_are_shown_as_described(tmp_path: Path) -> None:
    white = np.full((50, 100), 255, dtype=np.uint8)
    for taken, sure in (('type = "uint8"\nlayout = "nhwc"', 255.9), ('colour = "grey"\nmean = [0.5]', 1.4)):
        (found,) = camera(write_camera_detector(tmp_path / "m.onnx", [[0, 0, 9, 9]], [sure], taken=taken)).detect(white)
        assert found.score == pytest.approx(0.9, abs=1e-3)


def test_a_cloud_detectors_boxes_stand_in_the_rig_frame(tmp_path: Path) -> None:
    row = [10, 2, -1, 4, 2, 1.6, 0]
    (found,) = cloud(write_cloud_detector(tmp_path / "m.onnx", [row], [3.0])).detect(POINTS, RIG_SE3_LIDAR)
    box = found.box
    assert (box.x_m, box.y_m, box.z_m, box.height_m) == pytest.approx((-2, 1.8, 10, 1.6))
    assert abs(math.cos(box.yaw_rad)) == pytest.approx(0, abs=1e-6)  # along the road
    assert (np.ptp(box.footprint_m[:, 1]), np.ptp(box.footprint_m[:, 0])) == pytest.approx((4, 2), abs=1e-5)
    assert found.label == "Car"


def test_a_cloud_detector_may_work_in_the_cameras_frame_as_pointrcnn_does(tmp_path: Path) -> None:
    taken, given = 'frame = "camera"\nx_m = [-40.0, 40.0]\ny_m = [-3.0, 3.0]\nz_m = [0.0, 70.0]', "centred = false"
    path = write_cloud_detector(tmp_path / "m.onnx", [[2, 1.7, 15, 4, 2, 1.5, 0.3]], [9.0], taken=taken, given=given)
    (found,) = cloud(path).detect(POINTS, RIG_SE3_LIDAR)
    assert found.box == SolidBox(2, pytest.approx(1.7), 15, 4, 2, 1.5, pytest.approx(0.3))
    assert found.score == pytest.approx(9 - 11 / 4)  # the mean of x = 0, y = 1, z = 10 and an empty column


def test_a_grid_seen_from_above_holds_a_one_where_there_is_a_point_and_boxes_may_lack_height(tmp_path: Path) -> None:
    taken = (
        'kind = "grid"\nx_m = [0.0, 20.0]\ny_m = [-10.0, 10.0]\nz_m = [-2.0, 0.0]\ncell_m = 10.0\nslices = 1\nempty = 1'
    )
    given = 'columns = ["x", "y", "width", "length", "yaw"]\nground_m = -1.5'
    path = write_cloud_detector(tmp_path / "m.onnx", [[10, 0, 2, 4, 0]], [1.0], taken=taken, given=given)
    (found,) = cloud(path).detect(POINTS, RIG_SE3_LIDAR)
    assert (found.box.y_m, found.box.height_m) == pytest.approx((1.5, 1.6))
    assert found.score == pytest.approx(1 - 1 / 8)


def test_settings_identify_a_model(tmp_path: Path) -> None:
    first = find_detectors([f"onnx:{write_camera_detector(tmp_path / 'a.onnx', [[0, 0, 9, 9]], [0.9])}"])
    second = find_detectors([f"onnx:{write_camera_detector(tmp_path / 'b.onnx', [[0, 0, 8, 9]], [0.9])}", "geometric"])
    assert first.settings != second.settings
    assert (first.name, first.camera.labels) == ("a.onnx + geometric", {"Car", "Pedestrian"})
    assert json.loads(first.settings)["geometric"] == {"version": 1}


@pytest.mark.parametrize(
    ("names", "problem"),
    [
        (["yolo"], "there is no detector 'yolo'; use geometric, streets or onnx:FILE"),
        (["onnx:"], "there is no detector 'onnx:'"),
        (["onnx:none.onnx"], "no description beside the model"),
    ],
)
def test_an_unknown_detector_is_refused(names: list[str], problem: str) -> None:
    with pytest.raises(SettingError, match=problem):
        find_detectors(names)


def test_two_detectors_of_one_kind_are_refused(tmp_path: Path) -> None:
    path = write_camera_detector(tmp_path / "a.onnx", [[0, 0, 9, 9]], [0.9])
    with pytest.raises(SettingError, match="two detectors are given for a camera"):
        find_detectors([f"onnx:{path}"] * 2)


@pytest.mark.parametrize(
    ("toml", "problem"),
    [
        ("", "sensor is missing"),
        ('sensor = "radar"', "sensor is missing or unknown"),
        ('sensor = "camera"', "names makes no sense"),
        ('sensor = "camera"\nnames = ["Car"]\nscore = 2', "score makes no sense"),
        ('sensor = "camera"\nnames = ["Car"]\n[input]\nsize = [100000, 4]', "input.size makes no sense"),
        ('sensor = "camera"\nnames = ["Car"]\n[output]\nformat = "xxyy"', "output.format makes no sense"),
        (
            'sensor = "cloud"\nnames = ["Car"]\n[input]\nkind = "grid"\ncell_m = 0.001',
            "input.cell_m makes no sense.*values",
        ),
        ('sensor = "cloud"\nnames = ["Car"]\n[output]\ncolumns = ["x", "y"]', "output.columns makes no sense"),
        ('sensor = "cloud"\nnames = ["Car"]\n[input]\nsize = [4, 4]', "size is not known here"),
        ('sensor = "camera"\nnames = ["Car"]\n[input]\nname = "pixels"', "inputs are input.*names pixels"),
        ('sensor = "camera"\nnames = ["Car"]\n[input]\nname = "input"', "outputs are boxes, scores.*labels"),
    ],
)
def test_an_ill_formed_description_is_refused(tmp_path: Path, toml: str, problem: str) -> None:
    path = write_detector(tmp_path / "m.onnx", toml, [[0, 0, 9, 9]], [0.9], [1, 3, "H", "W"])
    with pytest.raises(SettingError, match=problem):
        find_detectors([f"onnx:{path}"])


def test_a_model_of_one_size_names_it(tmp_path: Path) -> None:
    toml = 'sensor = "camera"\nnames = ["Car"]\n[input]\nname = "input"\n[output]\nlabels = ""'
    path = write_detector(tmp_path / "m.onnx", toml, [[0, 0, 9, 9]], [0.9], [1, 3, 32, 64])
    with pytest.raises(SettingError, match=r"write size = \[32, 64\] under \[input\]"):
        find_detectors([f"onnx:{path}"])


def test_outputs_of_another_shape_than_described_are_an_error_of_the_description(tmp_path: Path) -> None:
    for rows, scores, given in (
        ([[0, 0, 9]], [0.9], 'labels = ""'),
        ([[0, 0, 9, 9]], [[0.9], [0.8]], ""),
        ([[0, 0, 9, 9]], [0.9], 'labels = ""\nobjectness = "boxes[7]"'),
    ):
        path = write_camera_detector(tmp_path / "m.onnx", rows, scores, given=given, labels=[0])
        with pytest.raises(SettingError, match="where its description means"):
            camera(path).detect(BLACK)


def test_a_file_that_is_not_a_model_is_refused(tmp_path: Path) -> None:
    path = write_camera_detector(tmp_path / "m.onnx", [[0, 0, 9, 9]], [0.9])
    path.write_bytes(b"no model")
    with pytest.raises(SettingError, match="no ONNX model that can be run"):
        camera(path)


@pytest.mark.parametrize("what", ["a file", "memory", "operators"])
def test_a_model_that_needs_other_files_or_operators_is_an_error(tmp_path: Path, what: str) -> None:
    path = write_camera_detector(tmp_path / "m.onnx", [[0, 0, 9, 9]], [0.9])
    path.write_bytes(hostile_models()[what].SerializeToString())
    with pytest.raises(SettingError, match=r"no ONNX model that can be run|the model fails"):
        camera(path).detect(BLACK)


def test_of_more_objects_than_anybody_needs_the_surest_stay(tmp_path: Path) -> None:
    rows = [[n, 0, n + 0.4, 9] for n in range(90)] + [[n, 10, n + 0.4, 19] for n in range(90)]
    rows += [[n, 20, n + 0.4, 29] for n in range(90)] + [[n, 30, n + 0.4, 39] for n in range(90)]
    found = camera(write_camera_detector(tmp_path / "m.onnx", rows, np.linspace(0.9, 0.3, 360))).detect(BLACK)
    assert len(found) == 300
    assert min(one.score for one in found) > 0.3

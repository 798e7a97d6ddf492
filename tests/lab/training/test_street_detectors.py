"""The detectors that come with auditor: their truth, their training, and what they find on streets never seen."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from auditor.errors import SettingError  # noqa: E402
from auditor.lab.evaluation.object_baseline import ObjectTask, evaluate_objects  # noqa: E402
from auditor.lab.evaluation.object_baseline.agreement import in_view  # noqa: E402
from auditor.lab.evaluation.object_baseline.detectors import find_detectors  # noqa: E402
from auditor.lab.evaluation.object_baseline.detectors.interface import SolidBox  # noqa: E402
from auditor.lab.evaluation.object_baseline.detectors.overlap import overlaps, overlaps_on_ground  # noqa: E402
from auditor.lab.evaluation.object_baseline.detectors.streets import clouds, images  # noqa: E402
from auditor.lab.evaluation.object_baseline.detectors.streets.network import packed, unpacked  # noqa: E402
from auditor.lab.evaluation.object_baseline.runner import street_labels  # noqa: E402
from auditor.lab.evaluation.sources import Street  # noqa: E402
from auditor.measurement import use_one_thread  # noqa: E402
from auditor.store.queries import run_query, run_sql  # noqa: E402
from auditor.store.store import Store  # noqa: E402
from tests.making.street_detectors import (  # noqa: E402
    CLOUDS,
    IMAGES,
    StreetFrame,
    Training,
    drawn_cloud,
    drawn_image,
    families_trained_on,
    street_frames,
    trained,
    training_streets,
)

FEW = Training(steps=2, batch=2)


@pytest.fixture(scope="module")
def frames() -> list[StreetFrame]:
    use_one_thread()
    return list(street_frames(training_streets(1)[0], 2))


@pytest.fixture(scope="module")
def held_out():
    """A frame of a street that was not trained on, and its truth as the leftmost camera sees it."""
    with Street(1000, 50).open() as (drive,):
        assert drive.street is not None
        return drive.rig, drive.street.frame(25), street_labels(drive.street, 25, drive.rig.n)


def test_the_truth_lies_where_the_sensors_see_it(held_out) -> None:
    rig, frame, labels = held_out
    points = frame.cloud.xyz_m @ rig.lidar.rig_SE3_lidar[:3, :3].T + rig.lidar.rig_SE3_lidar[:3, 3]
    seen = [label for label in labels if label.occluded == 0 and label.place_m[2] < 30 and label.truncated < 0.1]
    assert seen
    for label in seen:
        x, _, z = label.place_m
        near = points[np.hypot(points[:, 0] - x, points[:, 2] - z) < label.size_m[2] / 2]
        low, high = label.place_m[1] - label.size_m[0], label.place_m[1]
        assert np.count_nonzero((near[:, 1] > low) & (near[:, 1] < high - 0.1)) >= 20
        assert 3.5 < label.size_m[2] < 5.0
        assert 1.6 < label.size_m[1] < 1.9
        box = SolidBox(*label.place_m, label.size_m[2], label.size_m[1], label.size_m[0], label.yaw_rad)
        assert overlaps([in_view(box, rig.camera(rig.n))], [images.ImageBox(*label.box_px)])[0, 0] > 0.9
    assert {label.occluded for label in labels} > {0}  # some are hidden behind others


def test_boxes_come_back_from_the_numbers_that_stand_for_them() -> None:
    rng = np.random.default_rng(0)
    cells = rng.integers(0, 40, (20, 2)).astype(float)
    corner, size = rng.uniform(0, 300, (20, 2)), rng.uniform(5, 200, (20, 2))
    boxes = np.concatenate([corner, corner + size], axis=1)
    assert images.decoded(cells, images.encoded(cells, boxes)) == pytest.approx(boxes)
    places = rng.uniform([-25, 1, 0], [25, 2, 50], (20, 3))
    solid = np.column_stack([places, rng.uniform(1, 5, (20, 3)), rng.uniform(-1.5, 1.5, 20)])
    assert clouds.decoded(cells, clouds.encoded(cells, solid)) == pytest.approx(solid)


@pytest.mark.parametrize("drawn", [drawn_image, drawn_cloud])
def test_varied_frames_keep_their_truth(drawn, frames) -> None:
    """The input shows something within each box that is asked for; the same draw is the same frame."""
    for seed in range(6):
        shown, boxes, half_sides, _ = drawn(frames[0], np.random.default_rng(seed))
        again = drawn(frames[0], np.random.default_rng(seed))
        assert all(np.array_equal(one, other) for one, other in zip((shown, boxes), again, strict=False))
        assert len(boxes) == len(half_sides)
        if drawn is drawn_cloud:
            for x, _, z, length, *_ in boxes:
                reach = length / 2 / clouds.CELL_M
                row, column = z / clouds.CELL_M, x / clouds.CELL_M + clouds.CELLS / 2
                rows, columns = (slice(max(int(at - reach), 0), int(at + reach) + 1) for at in (row, column))
                assert shown[:-1, rows, columns].sum() >= 5


@pytest.mark.parametrize("kind", [IMAGES, CLOUDS], ids=["images", "clouds"])
def test_two_steps_of_training_are_repeatable_and_kept_in_a_file(kind, frames, tmp_path) -> None:
    runs = [list(trained(kind, frames, FEW)) for _ in range(2)]
    assert [loss for _, loss, _ in runs[0]] == [loss for _, loss, _ in runs[1]]
    network = runs[0][-1][2].eval()
    file = tmp_path / "weights.safetensors"
    file.write_bytes(packed(network))
    shown = torch.zeros((1, next(network.parameters()).shape[1], 64, 64))
    read = unpacked(kind.new_network(), file)
    with torch.inference_mode():
        assert torch.allclose(read.network(shown), network(shown), atol=0.02)
    with pytest.raises(SettingError, match="not the weights that come with auditor"):
        unpacked(kind.new_network(), file, "0" * 64)
    with pytest.raises(SettingError, match="No such file"):
        unpacked(kind.new_network(), tmp_path / "gone.safetensors")


def test_no_street_of_an_evaluation_and_no_family_left_out_is_trained_on() -> None:
    streets = training_streets(12)
    assert all(families_trained_on(street) and street.seed >= 20_000 for street in streets)
    assert not families_trained_on(Street(20_000, 60))  # industrial


def test_they_find_most_near_cars_of_a_street_never_seen(held_out) -> None:
    rig, frame, labels = held_out
    detectors = find_detectors(["streets"])
    assert detectors.camera is not None
    assert detectors.cloud is not None
    wanted = [one for one in labels if one.occluded <= 1 and one.truncated < 0.3 and one.place_m[2] < 30]
    in_image = [one.box for one in detectors.camera.detect(frame.images[rig.n].pixels) if one.score > 0.3]
    in_cloud = [
        one.box for one in detectors.cloud.detect(frame.cloud.xyz_m, rig.lidar.rig_SE3_lidar) if one.score > 0.3
    ]
    solid = [SolidBox(*one.place_m, *one.size_m[::-1], one.yaw_rad) for one in wanted]
    of_images = overlaps([images.ImageBox(*one.box_px) for one in wanted], in_image).max(axis=1, initial=0)
    of_clouds = overlaps_on_ground(solid, in_cloud).max(axis=1, initial=0)
    assert np.mean(of_images > 0.5) >= 0.7
    assert np.mean(of_clouds > 0.5) >= 0.7


def test_a_street_is_scored_by_its_own_truth(tmp_path) -> None:
    evaluate_objects(ObjectTask(Street(1000, 1), tmp_path / "audit", detectors=("streets",)), lambda *_: None)
    store = Store.open(tmp_path / "audit")
    rows = run_query(store, "evaluation_average_precision", {}).to_pylist()
    assert {(row["sensor"], row["strength"]) for row in rows} == {
        ("lidar", None),
        ("reference", None),
        ("reference", "mild"),
        ("reference", "opaque"),
    }
    assert all(row["truths"] > 0 and row["label"] == "Car" and row["detector"] == "streets" for row in rows)
    compared = run_sql(store, "SELECT best_iou, scores FROM object_cases WHERE len(attacked) = 1").to_pylist()
    for row in compared:
        known = [(iou, score) for iou, score in zip(row["best_iou"], row["scores"], strict=True) if iou is not None]
        assert all(len(iou) == len(score) for iou, score in known)


def test_both_have_one_name_and_a_second_detector_of_a_sensor_is_refused() -> None:
    assert find_detectors(["geometric", "streets"]).name == "streets"
    with pytest.raises(SettingError, match="two detectors are given for a camera"):
        find_detectors(["streets", "streets"])

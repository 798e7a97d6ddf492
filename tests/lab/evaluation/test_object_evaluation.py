"""The object-level baseline over whole recordings: compared once, resumed after a kill, scored by labels."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from auditor.cli import auditor
from auditor.errors import SettingError
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.evaluation import EvaluateTask, RecordingSource, evaluate_source, runner
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.object_baseline import ObjectTask, check_detectors, evaluate_objects
from auditor.lab.evaluation.object_baseline.agreement import AttackedObjects, in_view, scenarios
from auditor.lab.evaluation.object_baseline.average_precision import score_in_image, score_on_ground
from auditor.lab.evaluation.object_baseline.detectors import (
    Detection,
    Detectors,
    ImageBox,
    SolidBox,
    SolidDetection,
    find_detectors,
)
from auditor.lab.evaluation.object_baseline.kitti_labels import ObjectLabel, read_object_labels
from auditor.lab.simulation.drives import make_drive
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.rig import Triple
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.detector_models import write_camera_detector, write_cloud_detector
from tests.making.scenes import plane_rig
from tests.making.small_drives import write_drive

pytest.importorskip("onnxruntime")

FRAMES, CHUNK = 5, 2
CASES = FRAMES * (1 + 3 * (7 + 7 - 3))  # the two scenarios share three of their sets
OF_TWO_CAMERAS = 1 + 3 * 7  # they have one triple, which both scenarios share
LABEL = "{kind} 0.0 {occluded} 0.0 {box} 1.5 2.0 4.0 {x} 1.6 {z} 0.0"


def run(drive: Path, store: Path, *detectors: str, **task: object):
    wanted = ObjectTask(RecordingSource(drive), store, detectors=detectors or ("geometric",), **task)
    return evaluate_objects(wanted, lambda *_: None)


def content(store: Path) -> list[dict[str, object]]:
    return run_sql(Store.open(store), "SELECT * FROM object_cases ORDER BY ALL").to_pylist()


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "clean.mcap", FRAMES, positions_m=(0.6, 0.3, 0.0))


@pytest.fixture(scope="module")
def street():
    made = make_drive(3, 1, n_cameras=3)
    return made.rig, next(iter(made.frames()))


def test_a_bogus_wall_is_an_object_that_no_camera_sees(street) -> None:
    rig, frame = street
    objects = AttackedObjects(AttackedFrame(frame, rig, find_matcher("sgbm")), Detectors())
    triple = Triple(0, 1, 3)
    clean, attacked = objects.agreement(triple, {}), objects.agreement(triple, {0: BogusWall(8.0, 0.0, seed=1)})
    assert len(clean) > 3
    assert sum(one.iou < 0.5 for one in attacked) > sum(one.iou < 0.5 for one in clean)


def test_objects_are_detected_again_only_where_the_data_changed(street) -> None:
    rig, frame = street

    class Counting:
        labels, name, settings, calls = frozenset({"Car"}), "a", "{}", 0

        def detect(self, pixels):
            self.calls += 1
            return (Detection(ImageBox(10, 10, 60, 60), 0.9, "Car"),)

    detector = Counting()
    objects = AttackedObjects(AttackedFrame(frame, rig, find_matcher("sgbm")), Detectors(camera=detector))
    facula = Facula(255.0, 20.0, 60.0, 50.0)
    for attacks in ({}, {}, {1: facula}, {1: facula, 0: BogusWall(8.0, 0.0, seed=1)}):
        assert objects.agreement(Triple(1, 2, 3), attacks) == ((1.0, 0.9),) * 4  # both pairs, both ways
        objects.agreement(Triple(0, 1, 3), attacks)
    assert detector.calls == 3 + 1


def test_a_cloud_detectors_boxes_are_compared_in_every_image(street) -> None:
    rig, frame = street

    class Clouds:
        labels, name, settings = frozenset({"Car"}), "c", "{}"

        def detect(self, xyz_m, rig_SE3_lidar):
            return (SolidDetection(SolidBox(0.5, 1.6, 12.0, 4.0, 2.0, 1.5, 1.5), 0.9, "Car"),)

    class Cameras:
        labels, name, settings, at = frozenset({"Car"}), "a", "{}", 0

        def detect(self, pixels):
            self.at += 1  # called for S_1 first, then for S_3
            box = in_view(SolidBox(0.5, 1.6, 12.0, 4.0, 2.0, 1.5, 1.5), rig.camera((1, 3)[self.at - 1]))
            return (Detection(box, 0.9, "Car"),)

    detectors = Detectors(camera=Cameras(), cloud=Clouds())
    objects = AttackedObjects(AttackedFrame(frame, rig, find_matcher("sgbm")), detectors)
    assert [one.iou for one in objects.agreement(Triple(0, 1, 3), {})] == pytest.approx([1.0] * 4)
    assert objects.has_scores(Triple(0, 1, 3))
    assert not AttackedObjects(AttackedFrame(frame, rig, find_matcher("sgbm")), Detectors()).has_scores(Triple(0, 1, 3))


def test_the_papers_two_systems_are_compared() -> None:
    assert scenarios(plane_rig((0.6, 0.3, 0.0))) == (Triple(0, 1, 3), Triple(1, 2, 3))
    assert scenarios(plane_rig((0.6, 0.0))) == (Triple(0, 1, 2),)
    assert scenarios(plane_rig((0.6, 0.3, 0.0), lidar=False)) == (Triple(1, 2, 3),)


def test_the_baseline_goes_on_where_it_was_killed_and_in_shares(drive, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(runner, "CHUNK_FRAMES", CHUNK)
    whole = run(drive, tmp_path / "whole")
    assert (whole.frames, whole.cases) == (FRAMES, CASES)
    assert not run(drive, tmp_path / "whole").fresh
    compared = []

    def agreement(objects, *arguments, really=AttackedObjects.agreement):
        compared.append(1)
        if len(compared) > 150:  # of 220: in the second chunk
            raise KeyboardInterrupt
        return really(objects, *arguments)

    with monkeypatch.context() as patched:
        patched.setattr(AttackedObjects, "agreement", agreement)
        with pytest.raises(KeyboardInterrupt):
            run(drive, tmp_path / "killed")
    assert 0 < len(content(tmp_path / "killed")) < CASES
    for share in (0, 1):
        run(drive, tmp_path / "killed", share=share, of=2)
    assert content(tmp_path / "killed") == content(tmp_path / "whole")


def test_average_precision_falls_where_an_attack_makes_a_detector_unsure(drive, tmp_path) -> None:
    cars = [[20, 20, 80, 70], [150, 30, 220, 80]]
    camera = write_camera_detector(tmp_path / "camera.onnx", cars, [0.72, 0.6], given='labels = ""')
    labels = tmp_path / "labels" / "clean"
    labels.mkdir(parents=True)
    for frame in range(FRAMES):
        lines = [LABEL.format(kind="Car", occluded=0, box="20 20 80 70", x=0, z=20)]
        (labels / f"{frame:06}.txt").write_text("\n".join(lines))
    check_detectors((f"onnx:{camera}",), labels.parent)
    run(drive, tmp_path / "audit", f"onnx:{camera}", labels=labels.parent)
    rows = run_query(Store.open(tmp_path / "audit"), "evaluation_average_precision", {}).to_pylist()
    rows = {(row["strength"], row["size"]): row for row in rows if row["label"] == "Car"}
    assert rows.keys() == {
        (None, None),
        *((s, r) for s in ("mild", "opaque") for r in (37.5, 75, 112.5, 150, 187.5, 225)),
    }
    clean, blind = rows[None, None], rows["opaque", 225.0]
    assert (clean["truths"], clean["average_precision"]) == (FRAMES, 1.0)
    assert blind["average_precision"] < 1.0
    assert (blind["sensor"], blind["detector"]) == ("reference", "camera.onnx + geometric")
    assert not run(drive, tmp_path / "audit", f"onnx:{camera}", labels=labels.parent).fresh


def test_a_cloud_detector_is_scored_by_the_width_of_the_wall(drive, tmp_path) -> None:
    cloud = write_cloud_detector(tmp_path / "cloud.onnx", [[10, 0, -0.8, 4, 2, 1.5, 0]], [9.0])
    (tmp_path / "clean.txt").write_text(
        "\n".join(
            f"{frame} 0 " + LABEL.format(kind="Car", occluded=0, box="140 40 190 90", x=0, z=10)
            for frame in range(FRAMES)
        )
    )
    run(drive, tmp_path / "audit", f"onnx:{cloud}", labels=tmp_path)
    rows = run_query(Store.open(tmp_path / "audit"), "evaluation_average_precision", {}).to_pylist()
    assert [(row["sensor"], row["size"]) for row in rows] == [("lidar", s) for s in (None, 0.5, 1.0, 1.5, 2.0, 2.5)]
    assert all(row["truths"] == FRAMES for row in rows)


CAR = ObjectLabel("Car", 0.0, 0, (0, 0, 100, 50), (1.5, 2, 4), (0, 1.6, 20), 0.0)


def label(kind: str, *box: float, occluded: int = 0) -> ObjectLabel:
    return ObjectLabel(kind, 0.0, occluded, box, (1.5, 2, 4), (0, 1.6, 20), 0.0)


def found(score: float, *box: float) -> Detection:
    return Detection(ImageBox(*box), score, "Car")


def scored(detections: list[Detection], labels: list[ObjectLabel]):
    (one,) = score_in_image(3, detections, labels, frozenset({"Car"}))
    return one.truths, list(zip(one.scores, one.hits, strict=True))


def test_an_object_is_found_once_and_the_surest_finds_it() -> None:
    twice = [found(0.5, 0, 0, 100, 50), found(0.9, 0, 0, 100, 48)]
    assert scored(twice, [CAR]) == (1, [(0.9, True), (0.5, False)])
    assert scored([found(0.5, 0, 0, 100, 34)], [CAR]) == (1, [(0.5, False)])  # 0.68 of a car's 0.7


def test_objects_that_kitti_does_not_count_are_neither_hits_nor_false() -> None:
    here = [found(0.9, 0, 0, 100, 50)]
    assert scored(here, [label("Van", 0, 0, 100, 50)]) == (0, [])
    assert scored(here, [label("Car", 0, 0, 100, 50, occluded=2)]) == (0, [])
    assert scored(here, [label("DontCare", 0, 0, 200, 60)]) == (0, [])
    assert scored([found(0.9, 0, 0, 100, 20)], []) == (0, [])
    assert scored(here, [label("Truck", 0, 0, 100, 50)]) == (0, [(0.9, False)])
    assert scored([], [label("Car", 0, 0, 100, 20)]) == (0, [])


def test_boxes_in_space_are_scored_from_above_and_only_where_the_image_shows_them() -> None:
    camera = plane_rig().camera(3)
    near, far = (SolidDetection(SolidBox(x, 1.6, 20, 4, 2, 1.5, 0.0), 0.9, "Car") for x in (0.2, 40.0))
    (one,) = score_on_ground(0, [near, far], [CAR], frozenset({"Car"}), lambda box: in_view(box, camera))
    assert (one.sensor, one.truths, one.hits, one.iou) == (0, 1, (True,), 0.7)


def test_labels_of_both_benchmarks_are_read(tmp_path) -> None:
    line = LABEL.format(kind="Car", occluded=1, box="1 2 3 4", x=5, z=6)
    (tmp_path / "000007.txt").write_text(line + "\n")
    (tmp_path / "0002.txt").write_text(f"2 17 {line}\n")
    (tmp_path / "drive.txt").write_text(f"2 17 {line}\n2 -1 {line}\n")
    tracked = read_object_labels(tmp_path, "drive.mcap")
    assert {frame: len(of_it) for frame, of_it in tracked.frames.items()} == {0: 0, 1: 0, 2: 2}
    assert tracked.frames[2][0] == ObjectLabel("Car", 0.0, 1, (1, 2, 3, 4), (1.5, 2, 4), (5, 1.6, 6), 0.0)
    (tmp_path / "0002.txt").unlink()
    assert read_object_labels(tmp_path, "other.mcap").frames == {7: (tracked.frames[2][0],)}


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("Car 0 0", "line 1 is not a label of KITTI's.*3 fields"),
        ("Car " + "x " * 14, "not a label"),
        ("Car" + " nan" * 14, "finite"),
    ],
)
def test_an_ill_formed_label_is_an_error_with_its_line(tmp_path, text: str, problem: str) -> None:
    (tmp_path / "000000.txt").write_text(text)
    with pytest.raises(SettingError, match=problem):
        read_object_labels(tmp_path, "drive")


def test_labels_that_are_not_there_or_score_no_detector_are_refused(tmp_path) -> None:
    with pytest.raises(SettingError, match=r"no labels of 'drive'.*drive\.txt"):
        read_object_labels(tmp_path, "drive.mcap")
    with pytest.raises(SettingError, match="labels need a detector"):
        check_detectors(("geometric",), tmp_path)


def test_the_command_compares_objects_too_and_the_query_answers(tmp_path, monkeypatch) -> None:
    drive, store = write_drive(tmp_path / "short.mcap", 1, positions_m=(0.6, 0.0)), str(tmp_path / "audit")
    with monkeypatch.context() as patched:  # all that is no object is measured before, in few cases
        few = [replace(one, cases=lambda *_: iter(())) for one in runner.experiments_of(())]
        patched.setattr(runner, "experiments_of", lambda _: few)
        evaluate_source(EvaluateTask(RecordingSource(drive), tmp_path / "audit"), lambda *_: None)
    arguments = ["evaluate", str(drive), "--store", store, "--jobs", "1", "--detector", "geometric"]
    done = CliRunner().invoke(auditor, arguments)
    assert done.exit_code == 0, done.stderr
    assert f"short.mcap, objects: 1 frames, {OF_TWO_CAMERAS} cases measured" in done.stderr
    queried = CliRunner().invoke(auditor, ["query", "evaluation_objects", "--store", store, "--format", "json"])
    rows = json.loads(queried.stdout)
    assert {row["iou"] for row in rows} == {0.5, 0.7}
    assert all(row["cases"] in (1, 7) and row["frames"] == 1 for row in rows)


def test_a_detector_of_colours_is_shown_colours(tmp_path) -> None:
    path = write_camera_detector(tmp_path / "m.onnx", [[0, 0, 9, 9]], [0.9])
    detector = find_detectors([f"onnx:{path}"]).camera
    assert detector.detect(np.zeros((20, 20), dtype=np.uint8)) == detector.detect(np.zeros((20, 20, 3), dtype=np.uint8))

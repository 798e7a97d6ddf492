"""The object-level baseline on the evaluation page: beside the paper's, with the false alarms that it costs."""

import numpy as np
import pytest

from auditor.lab.evaluation.experiments import EXPERIMENTS
from auditor.reporting.evaluation import published
from auditor.reporting.evaluation.loading import load_evaluation, render_evaluation
from auditor.reporting.evaluation.page import Rate
from auditor.reporting.evaluation.plots import BOTTOM_PX, LEFT_PX, RIGHT_PX, TOP_PX
from auditor.store.evaluation_tables import ObjectCase, ObjectPart
from auditor.store.queries import run_query
from tests.making.evaluated_stores import evaluated
from tests.making.evaluation_cases import write
from tests.making.pages import HOSTILE, Page
from tests.making.stores import make_rig, part_columns

RIG = make_rig(3)
SETS = ((0,), (1,), (3,), (0, 1), (0, 3), (1, 3), (0, 1, 3), (2,), (1, 2), (2, 3), (1, 2, 3))
FRAMES = 12


def add_objects(store, detector, settings, experiment, cases):
    shared = part_columns(RIG, "0", experiment, drawn=1, name="a.mcap")
    part = ObjectPart(**shared, detector=detector, detector_settings=settings, labels=None)
    write(store, part, cases)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    made = evaluated(
        tmp_path_factory.mktemp("objects"), RIG, frames=FRAMES, names=("a.mcap",), experiments=EXPERIMENTS[:2]
    )
    rng = np.random.default_rng(2)

    def overlaps(*attacked):
        return [
            rng.uniform(0.3 if attacked else 0.6, 1, 5).tolist() if set(attacked) <= set(t) and t != (0, 2, 3) else None
            for t in ((0, 1, 3), (0, 2, 3), (1, 2, 3))
        ]

    for detector, settings in (("geometric", "{}"), (HOSTILE, '{"camera": 1}')):
        clean = [ObjectCase(f, f, 0, (), None, None, None, overlaps(), [None] * 3, []) for f in range(FRAMES)]
        attacked = [
            ObjectCase(f, f, 0, s, strength, None, None, overlaps(*s), [None] * 3, [])
            for f in range(FRAMES)
            for strength in ("mild", "strong", "opaque")
            for s in SETS
        ]
        add_objects(made, detector, settings, "clean", clean)
        add_objects(made, detector, settings, "combinations", attacked)
    return made


@pytest.fixture(scope="module")
def page(store):
    return load_evaluation(store)


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    """A store in which a camera's and a cloud's detector were scored."""
    made = evaluated(tmp_path_factory.mktemp("scored"), RIG, frames=2, names=("a.mcap",), experiments=EXPERIMENTS[:2])

    def case(attacked, strength, size, share, hits):
        sensor = attacked[0] if attacked else 0
        one = {"sensor": sensor, "label": "Car", "iou": 0.7, "truths": 2, "scores": [0.9, 0.8], "hits": hits}
        both = [one] if attacked else [one, {**one, "sensor": 3}]
        return ObjectCase(0, 0, 0, attacked, strength, size, share, [None] * 3, [None] * 3, both)

    add_objects(made, "yolo.onnx + pixor.onnx", "{}", "clean", [case((), None, None, None, [True, True])])
    walls = [case((0,), None, width, None, [True, width < 2]) for width in (0.5, 2.5)]
    faculas = [case((3,), "mild", radius, 0.1, [radius < 100, False]) for radius in (37.5, 225.0)]
    add_objects(made, "yolo.onnx + pixor.onnx", "{}", "sensitivity", [*walls, *faculas])
    return made


def test_the_page_shows_detection_and_false_alarms_beside_the_papers(store, page):
    grids = page.setups[0].grids["objects"]
    assert [grid.title.partition("; ")[2] for grid in grids[:3]] == [
        "any object without a partner raises a frame",
        "in sample, as in the paper",
        "left out by blocks of ten frames",
    ]
    assert all(len(grid.rows) in (2, 4) for grid in grids)
    assert not grids[0].unresolved  # it has no r
    rows = run_query(store, "evaluation_objects", {"r": "0.05"}).to_pylist()
    row = next(
        r
        for r in rows
        if (r["detector"], r["left_out"], r["scenario"], r["iou"], r["r"], r["strength"], r["attacked"])
        == ("geometric", "nothing", 1, 0.7, 0.05, "opaque", None)
    )
    shown = next(g for g in grids if g.title == "geometric; in sample, as in the paper").rows[3]
    assert shown.label == "IoU 0.7, r = 5 %"
    assert shown.cells[0] == published.BASELINE["0.7"][0]
    assert shown.cells[3] == Rate(row["detected"], row["cases"], row["low"], row["high"], row["resolvable"])
    assert (shown.cells[4].k, shown.cells[4].n) == (row["raised"], FRAMES)


def test_each_combination_has_its_row_and_names_from_outside_are_escaped(page):
    tables = page.setups[0].grids["object_combinations"]
    assert [len(table.rows) for table in tables] == [7] * 4
    html = Page(render_evaluation(page))
    assert "The object-level baseline (Table I)" in html.text
    assert not [tag for tag, _ in html.elements if tag == "script"]


def test_average_precision_is_drawn_by_size_with_clean_frames_for_comparison(scored):
    page = load_evaluation(scored)
    (sheet,) = page.setups[0].sheets["precision"]
    cloud, camera = sheet.panels
    assert cloud.title == "Car by yolo.onnx + pixor.onnx in the point cloud, IoU 0.7"
    assert [line.style for line in cloud.lines] == ["line wall", "line any"]
    assert [line.style for line in camera.lines] == ["line mild", "line any"]
    assert cloud.lines[1].path.count(f" {TOP_PX}") == 2  # everything is found in clean frames
    for panel in sheet.panels:
        assert all(LEFT_PX <= tick.at_px <= RIGHT_PX for tick in panel.x_ticks)
    assert f" {BOTTOM_PX}" in camera.lines[0].path  # nothing is, where the facula is large
    table = page.setups[0].grids["precision"][0]
    assert [row.cells for row in table.rows] == [("1.000",), ("1.000",), ("0.500",)]
    assert "What attacks do to object detectors" in Page(render_evaluation(page)).text

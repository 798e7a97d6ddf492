"""The SQL tables of the object-level baseline equal the same tables computed in Python from the stored rows."""

from collections import defaultdict
from decimal import Decimal
from functools import reduce
from itertools import combinations
from operator import add

import numpy as np
import pytest

from auditor.identification.thresholds import resolvable, threshold
from auditor.model.rig import Triple
from auditor.store.evaluation_tables import ObjectCase, ObjectPart, finished_part, part_writer
from auditor.store.queries import run_query
from tests.making.evaluation_cases import write
from tests.making.stores import PERIOD_NS, make_rig, new_store, part_columns

RATES = [Decimal(text) for text in ("0", "0.1", "0.3", "1")]
IOUS = ("0.5", "0.7")
BLOCK = 4
RIG = make_rig(3)
SCENARIOS = (Triple(0, 1, 3), Triple(1, 2, 3))
FRAMES = {"a": 9, "b": 6}
DETECTORS = {"geometric": "{}", "yolo.onnx + pixor.onnx": '{"camera": 1}'}
"""Only the latter say how sure they are."""


def part(recording, experiment, detector="geometric", chunk=0):
    return ObjectPart(
        **part_columns(RIG, recording, experiment, chunk=chunk),
        detector=detector,
        detector_settings=DETECTORS[detector],
        labels=None,
    )


def drawn_overlaps(rng, attacked):
    """Agreement that is worse under attack, at times exactly at the limit, at times without any object."""
    found = []
    for triple in RIG.triples:
        if triple not in SCENARIOS or not set(attacked) <= set(triple) or rng.random() < 0.05:
            found.append(None)
            continue
        values = np.clip(rng.normal(0.5 if attacked else 0.8, 0.2, rng.integers(0, 6)), 0, 1).round(1)
        found.append(values.tolist())
    return found


def drawn_scores(rng, size):
    count = int(rng.integers(0, 5))
    scores = rng.integers(2, 6, count) / 8
    hits = rng.random(count) < (0.8 if size is None else 0.6 - size / 10)
    truths = int(hits.sum() + rng.integers(0, 2))
    found = {"scores": scores.tolist(), "hits": hits.tolist(), "truths": truths}
    return [{"sensor": 0, "label": "Car", "iou": 0.7, **found}]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A store of two recordings and two detectors, and all of its cases by detector, experiment and recording."""
    store = new_store(tmp_path_factory.mktemp("objects"))
    store.write_rig(RIG)
    rng = np.random.default_rng(5)
    cases = defaultdict(list)
    sets = sorted({s for t in SCENARIOS for size in (1, 2, 3) for s in combinations(t, size)})
    for detector in DETECTORS:
        for recording, frames in FRAMES.items():
            for frame in range(frames):

                def case(attacked=(), strength=None, size=None, scored=(), *, at=frame, detector=detector):
                    overlaps = drawn_overlaps(rng, attacked) if size is None else [None] * len(RIG.triples)
                    sure = [of_it and (rng.integers(0, 9, len(of_it)) / 8).tolist() for of_it in overlaps]
                    scores = sure if detector != "geometric" else [None] * len(RIG.triples)
                    return ObjectCase(at, at * PERIOD_NS, 0, attacked, strength, size, None, overlaps, scores, scored)

                cases[detector, "clean", recording].append(case(scored=drawn_scores(rng, None)))
                cases[detector, "combinations", recording] += [case(s, "mild") for s in sets]
                cases[detector, "sensitivity", recording] += [
                    case((0,), None, width, drawn_scores(rng, width)) for width in (0.5, 2.5)
                ]
    for (detector, experiment, recording), of_it in cases.items():
        write(store, part(recording, experiment, detector), of_it)
    return store, cases


def unmatched(case, triple, iou):
    overlaps = case.best_iou[RIG.triples.index(triple)]
    if overlaps is None:
        return None
    scores = case.scores[RIG.triples.index(triple)]
    if scores is not None:
        return max((score for value, score in zip(overlaps, scores, strict=True) if value < iou), default=0.0)
    return sum(value < iou for value in overlaps) / len(overlaps) if overlaps else 0.0


def limits(cases, detector, triple, iou):
    """Threshold and N by (left_out, recording, block, r): the definition, spelled out."""
    clean = [
        (recording, case.frame // BLOCK, share)
        for recording in FRAMES
        for case in cases[detector, "clean", recording]
        if (share := unmatched(case, triple, iou)) is not None
    ]
    kept = {
        "nothing": lambda other, here: True,
        "block": lambda other, here: other != here,
        "recording": lambda other, here: other[0] != here[0],
    }
    found = {}
    for here in {(recording, block) for recording, block, _ in clean}:
        found[None, *here, None] = 0.0 if detector == "geometric" else 0.5, None
        for left_out, keeps in kept.items():
            samples = sorted(share for recording, block, share in clean if keeps((recording, block), here))
            for r in RATES:
                found[left_out, *here, r] = threshold(samples, r), len(samples)
    return found


@pytest.mark.parametrize("detector", DETECTORS)
def test_detection_and_false_alarms_equal_python(made, detector):
    expected = defaultdict(lambda: [0, 0])
    smallest = {}
    for triple in SCENARIOS:
        for iou in map(float, IOUS):
            for (left_out, recording, block, r), (limit, N) in limits(made[1], detector, triple, iou).items():
                for experiment in ("clean", "combinations"):
                    for case in made[1][detector, experiment, recording]:
                        share = unmatched(case, triple, iou)
                        if case.frame // BLOCK != block or share is None:
                            continue
                        for attacked in (case.attacked, None):
                            key = left_out, triple, iou, r, experiment, attacked
                            expected[key][0] += 1
                            expected[key][1] += share > limit
                            smallest[key] = min(smallest.get(key, N), N) if N else None
    rows = run_query(
        made[0], "evaluation_objects", {"block_frames": BLOCK, "r": ",".join(map(str, RATES)), "iou": list(IOUS)}
    ).to_pylist()
    rows = [row for row in rows if row["detector"] == detector]
    assert len(rows) == sum(key[4] == "combinations" for key in expected)
    for row in rows:
        r = None if row["r"] is None else Decimal(str(row["r"])).normalize() + 0
        attacked = None if row["attacked"] is None else tuple(row["attacked"])
        key = row["left_out"], Triple(row["i"], row["j"], row["k"]), row["iou"], r
        assert [row["cases"], row["detected"]] == expected[*key, "combinations", attacked], key
        assert [row["frames"], row["raised"]] == expected[*key, "clean", None], key
        assert row["rate"] == row["detected"] / row["cases"]
        assert row["false_alarm_rate"] == row["raised"] / row["frames"]
        assert row["low"] - 1e-12 <= row["rate"] <= row["high"] + 1e-12
        assert row["samples"] == smallest[*key, "combinations", attacked]
        assert row["resolvable"] is (None if r is None else resolvable(r, row["samples"]))
        assert row["scenario"] == (1 if row["i"] == 0 else 2)
    assert {row["left_out"] for row in rows} == {None, "nothing", "block", "recording"}


@pytest.mark.parametrize("points", [40, 11])
def test_average_precision_equals_python(made, points):
    rows = run_query(made[0], "evaluation_average_precision", {"points": points}).to_pylist()
    assert len(rows) == 3 * len(DETECTORS)
    for row in rows:
        scored = [
            one
            for experiment in ("clean", "sensitivity")
            for recording in FRAMES
            for case in made[1][row["detector"], experiment, recording]
            if case.size == row["size"]
            for one in case.scored
        ]
        found = [pair for one in scored for pair in zip(one["scores"], one["hits"], strict=True)]
        truths = sum(one["truths"] for one in scored)
        assert (row["cases"], row["truths"], row["detections"]) == (len(scored), truths, len(found))
        assert row["hits"] == sum(hit for _, hit in found)
        curve = []
        for limit in {score for score, _ in found}:
            taken = [hit for score, hit in found if score >= limit]
            curve.append((sum(taken), sum(taken) / len(taken)))
        steps = range(11) if points == 11 else range(1, 41)
        best = [max((p for hits, p in curve if hits * steps[-1] >= step * truths), default=0.0) for step in steps]
        assert row["average_precision"] == reduce(add, best) / points


def test_a_detector_that_finds_everything_and_nothing_else_has_an_average_precision_of_one(tmp_path):
    store = new_store(tmp_path)
    store.write_rig(RIG)
    scored = [{"sensor": 3, "label": "Car", "iou": 0.7, "truths": 2, "scores": [0.9, 0.8], "hits": [True, True]}]
    nothing = [{"sensor": 3, "label": "Cyclist", "iou": 0.5, "truths": 0, "scores": [0.5], "hits": [False]}]
    write(store, part("a", "clean"), [ObjectCase(0, 0, 0, (), None, None, None, *[[None] * 4] * 2, scored + nothing)])
    rows = run_query(store, "evaluation_average_precision", {}).to_pylist()
    assert [(r["sensor"], r["label"], r["average_precision"]) for r in rows] == [
        ("reference", "Car", 1.0),
        ("reference", "Cyclist", None),
    ]


def test_a_part_is_finished_with_its_last_row_only(tmp_path):
    store = new_store(tmp_path)
    which = part("a", "clean")
    with part_writer(store, which):
        pass
    assert finished_part(store, which) is None
    write(store, which, [])
    assert finished_part(store, which) is True
    assert part("a", "clean", "yolo.onnx + pixor.onnx").evaluation_id != which.evaluation_id

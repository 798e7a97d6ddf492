"""The ladders of an evaluation, and the largest attack that stays unseen, from their verdicts to the page."""

from collections import defaultdict

import pytest

from auditor.lab.evaluation.experiments import LADDERS, SeededDraws
from auditor.model.verdict import VerdictKind
from auditor.reporting.evaluation.loading import unseen_grids
from auditor.store.evaluation_tables import CaseVerdict, MeasuredCase, write_case_verdicts
from auditor.store.queries import run_query
from tests.making.evaluation_cases import CHECKS, RIG, part, write
from tests.making.scenes import plane_rig
from tests.making.small_drives import FOUR_CAMERAS
from tests.making.stores import PERIOD_NS, make_features, new_store

WIDTHS = (0.5, 1.0, 2.5)


def test_each_ladder_rises_on_one_sensor_and_varies_nothing_else():
    ladders = defaultdict(list)
    for case in LADDERS.cases(plane_rig(FOUR_CAMERAS), SeededDraws(1, 2, 3, 0), ()):
        [(sensor, attack)] = case.attacks.items()
        ladders[sensor, case.attack, case.strength].append((case.size, attack.parameters))
    assert {sensor for sensor, *_ in ladders} == {0, 1, 2, 3, 4}
    for steps in ladders.values():
        sizes = [size for size, _ in steps]
        assert sizes == sorted(set(sizes))
        varied = [name for name in steps[0][1] if len({parameters[name] for _, parameters in steps}) > 1]
        assert len(varied) == 1


def test_ladders_are_climbed_in_one_of_ten_frames_that_are_attacked():
    assert [frame for frame in range(45) if LADDERS.takes(frame, 2)] == [0, 20, 40]


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Walls of two frames that are seen from 1 m on, and of one where 1 m is seen and a wider one is not."""
    store = new_store(tmp_path_factory.mktemp("unseen"))
    store.write_rig(RIG)
    which, measured, verdicts = part("a", "unseen"), [], []
    for frame, seen in enumerate(((1.0, 2.5), (1.0, 2.5), (1.0,), ())):
        for width in WIDTHS:
            key = frame, frame * PERIOD_NS, 0, (0,), "wall", "8 m away, m wide", width
            counts, statistics = [None] * len(RIG.measured_triples), [None] * len(CHECKS)
            measured.append(MeasuredCase(*key, None, {}, counts, statistics, make_features(RIG, frame)))
            kind = VerdictKind.ATTACKED if width in seen else VerdictKind.CLEAN
            verdicts.append(CaseVerdict(*key, RIG.sensors, "recording", 1, kind, ()))
    write(store, which, measured)
    write_case_verdicts(store, which.evaluation_id, verdicts)
    return run_query(store, "evaluation_unseen", {}).to_pylist()


def test_larger_attacks_than_one_that_is_seen_count_as_seen(rows):
    [row] = rows
    assert (row["attacked"], row["attack"], row["tried"]) == ([0], "wall", 4)
    assert (row["smallest"], row["largest"]) == (0.5, 2.5)
    assert (row["unseen_in_half"], row["unseen_at_best"]) == (0.5, 2.5)


def test_the_page_says_of_each_sensor_what_was_tried_and_what_stays_unseen(rows):
    [grid] = unseen_grids(rows)
    assert grid.title == "On S_0; left out by recording"
    assert [(row.label, row.cells) for row in grid.rows] == [
        ("wall, 8 m away, m wide", ("4", "0.5 to 2.5", "0.5", "2.5 and more"))
    ]
    [none] = unseen_grids([{**rows[0], "unseen_in_half": 0.0}])
    assert none.rows[0].cells[2] == "below 0.5"
    assert not list(unseen_grids([]))

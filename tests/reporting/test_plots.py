import math
from itertools import pairwise

import pytest

from auditor.model.rig import Triple
from auditor.reporting.plots import LEFT_PX, MOST_POINTS, RIGHT_PX, Series, StripRow, TimeAxis, draw, round_values

S = 1_000_000_000
TRIPLE = Triple(0, 1, 3)


def stamps(count, step_ns=S // 10):
    return [5 * S + index * step_ns for index in range(count)]


def points_of(path):
    return [tuple(map(float, part[1:].split())) for part in path.replace("L", " ;L").replace("M", " ;M").split(";")[1:]]


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.0, 0.5, ["0.0", "0.2", "0.4"]),
        (0.0, 0.053, ["0.00", "0.02", "0.04"]),
        (-0.3, 4.0, ["0", "1", "2", "3", "4"]),
        (-25.0, 25.0, ["−20", "−10", "0", "10", "20"]),  # noqa: RUF001  # the minus sign is meant
    ],
)
def test_ticks_are_round_numbers(low, high, labels):
    most = 3 if high < 1 else 5
    assert [label for _, label in round_values(low, high, most)] == labels


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), (1.0, 0.0), (0.0, math.inf), (math.nan, 1.0)])
def test_an_axis_without_length_has_no_ticks(low, high):
    assert round_values(low, high, 5) == []


def test_everything_lies_inside_the_plot():
    figure = draw(
        stamps(30),
        origin_ns=0,
        series=[Series("E", TRIPLE, [index / 10 for index in range(30)], 0.4)],
        rows=[StripRow("verdict", stamps(30), ["clean"] * 30)],
        shaded=[(0, 100 * S)],
    )
    (chart,) = figure.charts
    for x, y in points_of(chart.path):
        assert LEFT_PX <= x <= RIGHT_PX
        assert chart.top_px <= y <= chart.bottom_px
    (cell,) = figure.strips[0].cells
    assert (cell.x_px, cell.x_px + cell.width_px) == (LEFT_PX, RIGHT_PX)
    assert (figure.shaded[0].x_px, figure.shaded[0].width_px) == (LEFT_PX, RIGHT_PX - LEFT_PX)
    assert all(LEFT_PX <= tick.at_px <= RIGHT_PX for tick in figure.ticks)


def test_strips_and_charts_do_not_overlap():
    figure = draw(
        stamps(5),
        origin_ns=0,
        series=[Series("E", Triple(0, j, 9), [0.1] * 5, 0.2) for j in range(1, 8)],
        rows=[StripRow(str(index), stamps(5), ["0"] * 5) for index in range(4)],
    )
    edges = [(chart.top_px, chart.bottom_px) for chart in figure.charts]
    edges += [(strip.y_px, strip.y_px + 15) for strip in figure.strips]
    assert all(before[1] < after[0] for before, after in pairwise(edges))
    assert edges[-1][1] <= figure.axis_y_px


def test_all_charts_share_one_scale():
    low, high = Series("E", TRIPLE, [0.1, 0.1], 0.2), Series("E", TRIPLE, [0.8, 0.8], 0.2)
    figure = draw(stamps(2), origin_ns=0, series=[low, high])
    heights = [chart.bottom_px - points_of(chart.path)[0][1] for chart in figure.charts]
    assert heights[1] == pytest.approx(8 * heights[0], rel=0.01)


def test_the_line_breaks_where_nothing_was_measured_and_across_a_gap():
    times = stamps(9)
    del times[6:8]
    (chart,) = draw(times, origin_ns=0, series=[Series("E", TRIPLE, [0.1, 0.1, None, 0.1, 0.1, 0.1, 0.1], None)]).charts
    assert chart.path.count("M") == 3
    assert chart.path.count("L") == 3


def test_dots_tell_above_from_not_above():
    (chart,) = draw(stamps(4), origin_ns=0, series=[Series("E", TRIPLE, [0.1, 0.2, 0.3, None], 0.2)]).charts
    assert (chart.above.count("M"), chart.below.count("M")) == (1, 2)


def test_a_theta_below_every_error_is_not_drawn():
    (chart,) = draw(stamps(2), origin_ns=0, series=[Series("E", TRIPLE, [0.1, 0.1], -1.0)]).charts
    assert (chart.theta, chart.theta_y_px) == (-1.0, None)


def test_many_points_are_thinned_and_no_extreme_is_lost():
    errors = [0.1] * 20_000
    errors[7_777], errors[12_345] = 0.9, 0.0
    (chart,) = draw(stamps(20_000), origin_ns=0, series=[Series("E", TRIPLE, errors, 0.2)]).charts
    heights = [y for _, y in points_of(chart.path)]
    assert len(heights) <= 2 * MOST_POINTS
    assert max(heights) == chart.bottom_px
    assert min(heights) == pytest.approx(chart.top_px, abs=6)
    assert chart.path.count("M") == 1


def test_a_single_raised_frame_among_many_stays_visible():
    states = ["clean"] * 20_000
    states[9_999] = "attacked"
    (strip,) = draw(stamps(20_000), origin_ns=0, rows=[StripRow("verdict", stamps(20_000), states)]).strips
    assert [cell.state for cell in strip.cells] == ["clean", "attacked", "clean"]


def test_runs_of_a_strip_split_by_state_by_label_and_by_gap():
    times = [*stamps(4), *[stamp + 10 * S for stamp in stamps(4)]]
    states = ["clean", "attacked", "attacked", "", "clean", "clean", "clean", "clean"]
    labels = ["", "S1", "S2", "", "", "", "", ""]
    (strip,) = draw(times, origin_ns=0, rows=[StripRow("verdict", times, states, labels)]).strips
    assert [cell.state for cell in strip.cells] == ["clean", "attacked", "attacked", "clean"]


def test_a_label_that_would_not_fit_is_left_out():
    states = ["clean", *["attacked"] * 98, "clean"]
    wide = draw(stamps(100), origin_ns=0, rows=[StripRow("", stamps(100), states, ["S1"] * 100)]).strips[0].cells[1]
    states = [*["clean"] * 99, "attacked"]
    narrow = draw(stamps(100), origin_ns=0, rows=[StripRow("", stamps(100), states, ["S1"] * 100)]).strips[0].cells[1]
    assert (wide.label, narrow.label) == ("S1", "")


def test_a_single_frame_can_be_drawn():
    figure = draw(
        [5 * S], origin_ns=5 * S, series=[Series("E", TRIPLE, [0.1], 0.2)], rows=[StripRow("", [5 * S], ["0"])]
    )
    assert figure.strips[0].cells[0].width_px == RIGHT_PX - LEFT_PX


def test_long_recordings_are_told_in_minutes():
    assert TimeAxis([0, 299 * S], 0).unit == "min"
    assert TimeAxis(stamps(100), 0).unit == "s"

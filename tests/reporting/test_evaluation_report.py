"""The evaluation page: whole, escaped, and saying what the queries say."""

from itertools import product

import pytest
from click.testing import CliRunner

from auditor.cli import auditor
from auditor.errors import StoreError
from auditor.lab.evaluation.experiments import EXPERIMENTS, INTERVALS
from auditor.reporting.evaluation.loading import _how_seldom, load_evaluation, percent, render_evaluation
from auditor.reporting.evaluation.page import Grid, Rate
from auditor.reporting.evaluation.plots import (
    BOTTOM_PX,
    LEFT_PX,
    RIGHT_PX,
    TOP_PX,
    PlotAxes,
    RatePoint,
    histogram_panel,
)
from auditor.store.queries import run_query
from tests.making.evaluated_stores import evaluated
from tests.making.pages import BROWSER, HOSTILE, Page, browse
from tests.making.stores import make_rig, new_store


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    rig = make_rig(4, name=HOSTILE)
    return evaluated(tmp_path_factory.mktemp("evaluated"), rig, names=(HOSTILE, "b.mcap"), attacked=2)


@pytest.fixture(scope="module")
def page(store):
    return load_evaluation(store)


@pytest.fixture(scope="module")
def shown(page):
    return Page(render_evaluation(page))


def grid_of(page, kind, number=0) -> Grid:
    return page.setups[0].grids[kind][number]


def test_the_page_is_well_nested_whole_and_escaped(shown):
    assert "Identification (Table II)" in shown.text
    assert "What the audit cannot see on this rig" in shown.text
    assert not [tag for tag, _ in shown.elements if tag == "script"]
    assert not [attributes for _, attributes in shown.elements if {"src", "href", "onload"} & attributes.keys()]


def test_its_tables_hold_the_queries_answers_beside_the_papers(store, page, shown):
    rows = run_query(store, "evaluation_detection", {}).to_pylist()
    row = next(
        r
        for r in rows
        if (r["left_out"], r["i"], r["j"], r["strength"], r["attacked"], r["r"]) == ("block", 0, 1, "mild", None, 0.05)
    )
    table = grid_of(page, "detection", 1)
    assert table.groups == (("Scenario 1: S_0, S_1, S_4", 4), ("Scenario 2: S_1, S_2, S_4", 4))
    assert [one.label for one in table.rows] == ["r = 0 %", "r = 1 %", "r = 2 %", "r = 3 %", "r = 5 %"]
    assert table.rows[-1].cells[:2] == (
        "99.91 %",
        Rate(row["detected"], row["cases"], row["low"], row["high"], row["resolvable"]),
    )
    assert f"{row['detected']}/{row['cases']}" in shown.text


def test_both_methods_stand_side_by_side(store, page, shown):
    attacks, sizes = page.setups[0].grids["methods"]
    assert attacks.columns == ("E", "robust") * 3
    cells = {row.label: row.cells for row in attacks.rows}
    named = cells["two of 5 sensors attacked, opaque: exactly named"]
    misnamed = cells["two of 5 sensors attacked, opaque: a sensor named that was not"]
    alarms = cells["clean frames that are not clean, S_0, S_1, S_2, S_3, S_4"]
    rows = {
        (row["left_out"], row["method"]): row
        for row in run_query(store, "evaluation_identification", {"r": "0.01"}).to_pylist()
        if (len(row["system"]), row["strength"], row["attacked"], row["attacked_sensors"]) == (5, "opaque", None, 2)
    }
    clean = {
        (row["left_out"], row["method"]): row
        for row in run_query(store, "evaluation_false_alarms", {"r": "0.01"}).to_pylist()
        if len(row["system"]) == 5
    }
    for at, key in enumerate(product(("nothing", "block", "recording"), ("paper", "robust"))):
        row, resolvable = rows[key], rows[key]["resolvable"]
        assert named[at] == Rate(row["named"], row["cases"], row["low"], row["high"], resolvable)
        bounds = row["misnaming_low"], row["misnaming_high"]
        assert misnamed[at] == Rate(row["misnamed"], row["cases"], *bounds, resolvable)
        of_clean = clean[key]
        bounds = of_clean["not_clean_low"], of_clean["not_clean_high"]
        assert alarms[at] == Rate(of_clean["not_clean"], of_clean["frames"], *bounds, resolvable)
    assert named[0] != named[1]
    assert len(sizes.rows) == 5 + 2 * 2 * 6
    assert not [row for table in (attacks, sizes) for row in table.rows if None in row.cells]
    assert "Both methods" in shown.text


def test_what_is_not_judged_by_the_robust_method_is_not_compared(tmp_path):
    store = evaluated(tmp_path, make_rig(3), names=("a.mcap",), frames=4, attacked=2)
    for path in (store.folder / "case_verdicts").iterdir():
        path.unlink()
    setup = load_evaluation(store).setups[0]
    assert setup.grids["methods"] == ()
    assert setup.grids["detection"][0].rows[1].cells[1] is not None


def test_incidents_stand_on_the_page_by_both_methods(tmp_path):
    store = evaluated(tmp_path, make_rig(3), frames=20, experiments=(*EXPERIMENTS[:1], INTERVALS))
    shown = load_evaluation(store)
    [false] = shown.setups[0].grids["false_incidents"]
    assert [row.label for row in false.rows] == ["E and Algorithm 2", "robust"]
    assert not [row for row in false.rows if None in row.cells]
    rows = run_query(store, "evaluation_incidents", {}).to_pylist()
    for method, table in zip(("paper", "robust"), shown.setups[0].grids["intervals"], strict=True):
        [row] = [
            row
            for row in rows
            if (row["method"], row["left_out"], row["attacked"], row["variant"]) == (method, "block", [1], "still")
        ]
        cells = next(one.cells for one in table.rows if one.label == "S_1, still")
        assert cells[3] == Rate(row["found"], 4, row["low"], row["high"], row["resolvable"])
        assert cells[4].k == row["named"]
    assert "Attacks of one second, and lasting ones" in Page(render_evaluation(shown)).text


def test_an_attack_that_is_raised_no_oftener_than_clean_frames_cannot_be_seen():
    row = {"detected": 3, "cases": 40, "low": 0.026}
    assert _how_seldom(row, 0.03).startswith(
        "cannot be seen on this rig, as far as 40 frames tell: it was detected in 3,"
    )
    assert _how_seldom(row, 0.02) == "was detected in 3 of 40 frames."


def test_a_rate_below_one_in_n_is_flagged(page, shown):
    table = grid_of(page, "detection")
    assert [one.cells[1].resolvable for one in table.rows] == [True, False, False, False, True]
    assert table.unresolved
    assert "is not resolvable with" in shown.text


def test_there_is_a_panel_for_every_figure_of_the_paper(page):
    sheets = page.setups[0].sheets
    assert [len(sheet.panels) for sheet in sheets["detection"]] == [7, 7]
    assert [len(sheet.panels) for sheet in sheets["distribution"]] == [7, 7, 15]
    assert [len(sheet.panels) for sheet in sheets["identification"]] == [4]
    assert [len(sheet.panels) for sheet in sheets["sensitivity"]] == [3]


def test_all_marks_lie_inside_their_panels(page):
    for sheets in page.setups[0].sheets.values():
        for plot in (panel for sheet in sheets for panel in sheet.panels):
            for bar in plot.bars:
                assert LEFT_PX <= bar.x_px < bar.x_px + bar.width_px <= RIGHT_PX + 0.01
                assert TOP_PX - 0.01 <= bar.y_px <= bar.y_px + bar.height_px <= BOTTOM_PX + 0.01
            for tick in (*plot.x_ticks, *plot.y_ticks):
                assert TOP_PX <= tick.at_px <= RIGHT_PX


def test_what_is_seen_too_rarely_is_said_in_words(tmp_path):
    how = {"names": ("a.mcap",), "frames": 4, "attacked": 2}
    assert load_evaluation(evaluated(tmp_path / "sharp", make_rig(3), seen=1.0, **how)).setups[0].unseen == ()
    blind = load_evaluation(evaluated(tmp_path / "blind", make_rig(3), seen=0.0, **how)).setups[0].unseen
    assert any(s.startswith("A bogus wall, 1 m wide, on the LiDAR was detected in") for s in blind)
    assert any(s.startswith("Scenario 1: attacks with strong faculas on S_0") for s in blind)


@pytest.mark.parametrize(("n", "lidar"), [(2, True), (3, False), (4, False)])
def test_rigs_of_every_make_have_a_page(tmp_path, n, lidar):
    store = evaluated(tmp_path, make_rig(n, lidar=lidar), names=("a.mcap",), frames=1)
    shown = Page(render_evaluation(load_evaluation(store)))
    assert ("Identification (Table II)" in shown.text) == (n + lidar >= 4)
    assert ("Wall on the LiDAR" in shown.text) == lidar


def test_an_evaluation_that_has_only_begun_has_a_page(tmp_path):
    store = evaluated(tmp_path, make_rig(3), names=("a.mcap",), frames=4, experiments=EXPERIMENTS[:1])
    assert "False alarms" in Page(render_evaluation(load_evaluation(store))).text


def test_a_store_without_an_evaluation_says_what_to_do(tmp_path):
    with pytest.raises(StoreError, match="attack clean recordings with auditor evaluate"):
        load_evaluation(new_store(tmp_path))


def test_the_command_writes_the_page_and_refuses_a_recording(store, tmp_path):
    out = tmp_path / "page.html"
    arguments = ["report", "evaluation", "--store", str(store.folder), "--out", str(out)]
    done = CliRunner().invoke(auditor, arguments)
    assert done.exit_code == 0, done.stderr
    assert out.read_text("utf-8").startswith("<!DOCTYPE html>")
    refused = CliRunner().invoke(auditor, [*arguments, "--recording", "a"])
    assert refused.exit_code == 2
    assert "pools all" in refused.stderr


@pytest.mark.skipif(BROWSER is None, reason="no Chromium to open the page in")
def test_the_page_opens_in_a_browser_without_a_message_or_a_request(page, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(render_evaluation(page), "utf-8")
    console, addresses, dom = browse(path, tmp_path)
    assert "What the audit cannot see" in dom
    assert console == []
    assert addresses == []


def test_curves_and_bars_reach_where_they_should():
    line = PlotAxes(0, 1).line([RatePoint(0, 0, 0, 0.1), RatePoint(1, 1, 0.9, 1)], "line", marked=True)
    assert line.path == f"M{LEFT_PX:.1f} {BOTTOM_PX}L{RIGHT_PX:.1f} {TOP_PX}"
    assert line.whiskers.endswith(f"V{TOP_PX}")
    first, second = histogram_panel("", [("bar", [3, 0, 1, 0])]).bars
    assert (first.y_px, second.x_px) == (TOP_PX, PlotAxes(0, 1).x(0.5))
    assert second.height_px == pytest.approx((BOTTOM_PX - TOP_PX) / 3, abs=0.01)


def test_a_percentage_is_never_rounded_to_none_or_all():
    assert [percent(share).replace("\u00a0", " ") for share in (0, 0.0002, 0.5, 0.9998, 1)] == [
        "0.0 %",
        "0.02 %",
        "50.0 %",
        "99.98 %",
        "100.0 %",
    ]

"""Macros: arithmetic in SQL gives what Python's gives, and evidence is put into words."""

import math

import pytest

from auditor.identification.cross_validation import wilson
from auditor.model.verdict import Cause
from auditor.store.queries import run_sql
from tests.making.stores import new_store


def test_wilsons_interval_in_sql_is_pythons_and_stays_within_0_and_1(tmp_path):
    """All k up to n = 60, and the ends and the middle of larger n, where rounding pushes an end out of its place."""
    pairs = [(k, n) for n in range(61) for k in range(n + 1)]
    pairs += [(k, n) for e in range(2, 10) for n in (10**e, 10**e + 7) for k in (0, 1, n // 3, n // 2, n - 1, n)]
    values = ", ".join(f"({k}::BIGINT, {n}::BIGINT)" for k, n in pairs)
    sql = f"SELECT k, n, wilson(k, n, -1) AS low, wilson(k, n, 1) AS high FROM (VALUES {values}) AS pair(k, n)"
    rows = run_sql(new_store(tmp_path), sql).to_pylist()
    assert len(rows) == len(pairs)
    for row in rows:
        if row["n"] == 0:
            assert (row["low"], row["high"]) == (None, None)
            continue
        assert 0 <= row["low"] < row["high"] <= 1, row
        assert (row["low"] == 0, row["high"] == 1) == (row["k"] == 0, row["k"] == row["n"]), row
        for found, expected in zip((row["low"], row["high"]), wilson(row["k"], row["n"]), strict=True):
            assert math.isclose(found, expected, rel_tol=0, abs_tol=1e-12), row


@pytest.mark.parametrize(
    ("evidence", "words"),
    [
        (("lidar_conflict", 0, None), "the cameras disagree with the LiDAR"),
        (("added_light", 2, None), "S_2 sees light that others do not"),
        (("added_light", 2, 3), "S_2 or S_3 alone sees light"),
        (("removed_light", 2, None), "S_2 lacks light that others see"),
        (("photometric_inconsistency", 2, None), "S_2 does not see what others see"),
        (("photometric_inconsistency", 2, 3), "S_2 and S_3 do not see the same"),
        (("point_dropout", 0, None), "the LiDAR lacks points"),
        (("isolated_points", 0, None), "the LiDAR has isolated points"),
        (("striped_light", 2, None), "S_2 has light in some rows that others do not"),
        (("striped_light", 2, 3), "S_2 or S_3 alone has light in some rows"),
        (("lost_returns", 0, None), "the LiDAR has no return from what the cameras see"),
        (("false_ranges", 0, None), "the LiDAR has points where the cameras see nothing"),
        (("rough_ranges", 0, 3), "the LiDAR's ranges are noisy in a part of the view of S_3"),
    ],
)
def test_evidence_is_told_of_a_sensor_or_of_two_cameras_alone(tmp_path, evidence, words):
    name, i, k = evidence
    piece = f"{{check_name: '{name}', i: {i}, j: NULL::TINYINT, k: {'NULL::TINYINT' if k is None else k}, score: 3.5}}"
    [row] = run_sql(new_store(tmp_path), f"SELECT evidence_in_words([{piece}]) AS told").to_pylist()
    assert row["told"] == f"{words} (+3.50)"


def test_every_cause_has_words_of_its_own(tmp_path):
    causes = ", ".join(f"('{cause}')" for cause in Cause)
    sql = f"SELECT DISTINCT cause_in_words(cause, 2) AS told FROM (VALUES {causes}) AS known(cause)"
    told = {row["told"] for row in run_sql(new_store(tmp_path), sql).to_pylist()}
    assert len(told - {None}) == len(Cause)


@pytest.mark.parametrize("cause", sorted(set(Cause) - {Cause.DARK}))
def test_what_affects_one_sensor_names_it(tmp_path, cause):
    [row] = run_sql(new_store(tmp_path), f"SELECT cause_in_words('{cause}', 2) AS told").to_pylist()
    assert "S_2" in row["told"]

"""Around a case lies its own drive."""

from dataclasses import replace

from auditor.identification.causes import bounds_nearby
from auditor.lab.evaluation.case_series import CaseSeries
from auditor.store.case_arrays import load_cases
from tests.making.evaluation_cases import make_evaluation, system_of


def test_what_follows_in_time_with_another_rig_is_not_nearby(tmp_path):
    """A recording whose calibration changes has two drives, and the second begins where the first ends."""
    store, _ = make_evaluation(tmp_path)
    cases = next(iter(load_cases(store)))
    recording, last = max(cases.known, key=lambda one: one.frame).recording_id, 4
    two_rigs = [
        replace(one, stamp_ns=one.frame * 2 * 10**9, rig_id="before" if one.frame <= last else "after")
        for one in cases.known
    ]
    clean = {
        one.frame: place
        for place, one in enumerate(two_rigs)
        if one.experiment == "clean" and one.recording_id == recording
    }
    around = CaseSeries(replace(cases, known=two_rigs))
    series, rows = around.series([clean[last], clean[last + 1]], system_of((0, 1, 2, 3, 4)))
    first, end = bounds_nearby(series.stamps_ns, series.runs)
    before, after = rows
    assert (first[before], end[before]) == (before - 1, before + 1)
    assert (first[after], end[after]) == (after, after + 2)

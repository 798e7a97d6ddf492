"""Stretches of a recording that are judged as a whole."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.identification.incidents.events import (
    HeldEvent,
    HeldFrame,
    LastingEvent,
    lasting_events,
    of_stretch,
    outer_halves,
    series_of,
    windows_of,
    with_lasting,
)
from auditor.identification.incidents.series import FrameSeries
from auditor.model.calibration import NullDistribution
from auditor.model.checks import Check, SensorCheck
from auditor.model.verdict import Verdict, VerdictKind

NAN = np.nan
ATTACKED, UNIDENTIFIED, SUSPECT = VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED, VerdictKind.SUSPECT


def stamps(frames, hz=10.0):
    return (np.arange(frames) * 1e9 / hz).astype(np.int64)


@pytest.mark.parametrize(("hz", "frames", "length"), [(10, 100, 12), (20, 100, 24), (2, 100, 9), (10, 10, 10)])
def test_a_window_lasts_for_a_second_or_so_and_has_a_few_frames(hz, frames, length):
    windows = windows_of(stamps(frames, hz), np.zeros(frames, dtype=np.int64))
    assert set((windows.end - windows.first).tolist()) == {length}
    assert (windows.first[0], windows.end[-1]) == (0, frames)


def test_no_window_crosses_a_gap_and_few_frames_have_none():
    runs = np.repeat([0, 1, 2], [20, 5, 15])
    windows = windows_of(stamps(40), runs)
    assert all(runs[a] == runs[b - 1] for a, b in zip(windows.first, windows.end, strict=True))
    assert set(runs[windows.first].tolist()) == {0, 2}
    assert not len(windows_of(stamps(3), np.zeros(3, dtype=np.int64)).first)
    assert not len(windows_of(stamps(0), np.zeros(0, dtype=np.int64)).first)


def test_a_value_of_a_window_is_the_median_of_what_was_measured_in_most_of_it():
    values = np.stack([np.arange(12.0), np.full(12, NAN), np.where(np.arange(12) % 2, 5.0, NAN)], axis=1)
    values[3, 0] = 99.0
    values[:8, 2] = 5.0
    here = np.ones((12, 2), dtype=np.bool_)
    runs = np.zeros(12, dtype=np.int64)
    series = FrameSeries(stamps(12), runs, values, here, ~here)
    [row] = series_of(series, windows_of(series.stamps_ns, runs)).statistics.tolist()
    assert row == [6.5, pytest.approx(NAN, nan_ok=True), 5.0]


def test_what_is_expected_of_a_stretch_is_narrower_than_of_a_frame():
    light = SensorCheck(Check.ADDED_LIGHT, 1, (2, 3, 4))
    frame = NullDistribution(-2.9, 0.8, 0.57, 3, 100, 0.0)
    assert of_stretch(light, frame).deviation < 0.6 * frame.deviation
    assert of_stretch(light, frame).mean == frame.mean


def lasting(verdicts, explained=(), frames=60, reached=None):
    runs = np.zeros(frames, dtype=np.int64)
    windows = windows_of(stamps(frames), runs)
    beyond = np.full(len(windows.first), -1.0)
    beyond[[*verdicts, *explained]] = 1.0
    edges = outer_halves(windows, runs)[0] if reached is None else reached
    return lasting_events(windows, beyond, {place: Verdict(*verdict) for place, verdict in verdicts.items()}, edges)


def test_an_event_goes_from_the_middle_of_its_first_window_to_that_of_its_last():
    [event] = lasting(dict.fromkeys(range(14, 25), (ATTACKED, "-", (2,))))
    assert (event.frames[0], event.frames[-1], event.attacked) == (20, 30, (2,))


def test_what_is_in_all_windows_holds_for_all_frames():
    [event] = lasting(dict.fromkeys(range(49), (ATTACKED, "-", (2,))))
    assert event.frames == tuple(range(60))


def test_an_event_reaches_the_ends_of_a_run_only_where_the_halves_there_show_it():
    every = dict.fromkeys(range(49), (ATTACKED, "-", (2,)))
    [event] = lasting(every, reached=())
    assert (event.frames[0], event.frames[-1]) == (6, 54)


def test_the_halves_of_windows_lie_at_the_ends_of_runs():
    runs = np.repeat([0, 1], [20, 12])
    halves, parts = outer_halves(windows_of(stamps(32), runs), runs)
    assert halves == [(0, False), (9, False), (8, True), (9, True)]
    assert list(zip(parts.first.tolist(), parts.end.tolist(), strict=True)) == [(0, 6), (20, 26), (14, 20), (26, 32)]


def test_windows_that_name_no_sensor_belong_to_those_around_them():
    verdicts = {place: (ATTACKED, "-", (2,)) if place % 3 else (UNIDENTIFIED, "-") for place in range(10, 20)}
    assert [(event.kind, event.attacked) for event in lasting(verdicts)] == [(ATTACKED, (2,))]
    assert [event.kind for event in lasting({12: (UNIDENTIFIED, "-")})] == [UNIDENTIFIED]


def test_what_a_fault_explains_in_most_windows_is_no_attack_where_it_does_not_quite_explain_it():
    verdicts = dict.fromkeys((17, 18), (ATTACKED, "-", (2,)))
    assert lasting(verdicts, explained=(15, 16, 19)) == []
    assert [event.attacked for event in lasting(verdicts, explained=(16, 19))] == [(2,)]


def test_sensors_attacked_one_after_the_other_are_events_of_their_own():
    verdicts = {place: (ATTACKED, "-", (1,) if place < 20 else (3,)) for place in range(10, 30)}
    assert [event.attacked for event in lasting(verdicts)] == [(1,), (3,)]


def held(frames, attacked, kind=ATTACKED):
    return HeldEvent(dict.fromkeys(frames, HeldFrame((kind, attacked), 0.5)))


LONG = LastingEvent(tuple(range(20, 40)), ATTACKED, (1,), 2.0, 6)


def test_an_event_of_stretches_takes_in_what_names_the_same_or_nothing():
    for brief in (held([25, 27], (1,)), held([25, 27], (), SUSPECT)):
        [event] = with_lasting([brief], [replace(LONG, frames=tuple(range(10, 40)))])
        assert event.named == {(1,)}
        assert list(event.frames) == [*range(10, 25), 25, 27, *range(28, 40)]


def test_at_its_ends_frames_say_more_than_half_a_stretch():
    [event] = with_lasting([held(range(23, 37), (1,))], [LONG])
    assert list(event.frames) == list(range(23, 37))


def test_frames_that_other_sensors_were_named_for_stay_theirs():
    other, event = with_lasting([held([25, 26], (2,))], [LONG])
    assert (list(other.frames), other.named) == ([25, 26], {(2,)})
    assert set(event.frames) == set(LONG.frames) - {25, 26}


def test_frames_that_are_held_for_a_sensor_more_say_where_a_stretch_begins_and_ends():
    both = dict.fromkeys(range(23, 28), HeldFrame((ATTACKED, (0, 1)), 0.5))
    brief = HeldEvent({**both, **held(range(28, 37), (1,)).frames})
    assert with_lasting([brief], [LONG]) == [brief]

import numpy as np

from auditor.identification.freezing import frozen


def frames(*columns):
    """Fingerprints by sensor, one text a sensor, one letter a frame; '-' where it is missing."""
    return [{s: ord(c[f]) for s, c in enumerate(columns) if c[f] != "-"} for f in range(len(columns[0]))]


def test_a_sensor_that_repeats_itself_while_another_goes_on_is_frozen():
    found = frozen(frames("abcdef", "aabbbb"), (0, 1))
    assert found.T.astype(int).tolist() == [[0] * 6, [0, 0, 0, 1, 1, 1]]


def test_one_repeat_is_not_enough():
    assert not frozen(frames("abcdef", "aabccd"), (0, 1)).any()


def test_where_everything_stands_still_nobody_is_frozen():
    assert not frozen(frames("aaaaab", "cccccc"), (0, 1))[:5].any()


def test_a_missing_sensor_is_not_frozen_and_a_gap_ends_a_run():
    found = frozen(frames("abcdefg", "aaa-aaa"), (0, 1))
    assert found[:, 1].astype(int).tolist() == [0, 1, 1, 0, 0, 1, 1]


def test_no_frames_and_one_frame_hold_nothing():
    assert frozen([], (0, 1)).shape == (0, 2)
    assert frozen([{0: 1}], (0, 1)).tolist() == [[False, False]]
    assert frozen(frames("ab", "aa"), (0, 1)).dtype == np.bool_

import numpy as np

from auditor.identification.statistics import frozen
from auditor.model.measurement import NO_FINGERPRINT


def frames(*columns):
    """Fingerprints and presence by frame and sensor, one text a sensor, one letter a frame; '-' where it is missing."""
    prints = np.array([[ord(letter) for letter in column] for column in columns], dtype=np.int64).T
    return prints, prints != ord("-")


def test_a_sensor_that_repeats_itself_while_another_goes_on_is_frozen():
    found = frozen(*frames("abcdef", "aabbbb"))
    assert found.T.astype(int).tolist() == [[0] * 6, [0, 0, 0, 1, 1, 1]]


def test_one_repeat_is_not_enough():
    assert not frozen(*frames("abcdef", "aabccd")).any()


def test_where_everything_stands_still_nobody_is_frozen():
    assert not frozen(*frames("aaaaab", "cccccc"))[:5].any()


def test_what_a_sensor_showed_long_before_is_frozen_only_where_it_may_have_been_replayed():
    prints, present = frames("abcdefgh", "abcdeabf")
    assert not frozen(prints, present).any()
    assert frozen(prints, present, replayed=True).T.astype(int).tolist() == [[0] * 8, [0, 0, 0, 0, 0, 1, 1, 0]]


def test_a_recording_that_was_played_twice_is_no_replay_of_one_sensor():
    assert not frozen(*frames("abcabc", "defdef"), replayed=True).any()


def test_a_missing_sensor_is_not_frozen_and_a_gap_ends_a_run():
    found = frozen(*frames("abcdefg", "aaa-aaa"))
    assert found[:, 1].astype(int).tolist() == [0, 1, 1, 0, 0, 1, 1]


def test_what_is_not_there_is_not_compared_whatever_fingerprint_stands_for_it():
    prints, present = frames("abcdefg", "aaaaaaa")
    present[3, 1] = False
    assert frozen(prints, present)[:, 1].astype(int).tolist() == [0, 1, 1, 0, 0, 1, 1]


def test_no_frames_and_one_frame_hold_nothing():
    assert frozen(*frames("", "")).shape == (0, 2)
    assert frozen(*frames("a", "-")).tolist() == [[False, False]]
    assert frozen(*frames("ab", "aa")).dtype == np.bool_


def test_a_sensor_without_a_fingerprint_is_not_frozen():
    prints, present = frames("abcdef", "aabbbb")
    prints[prints == ord("b")] = NO_FINGERPRINT
    assert not frozen(prints, present).any()

"""Frames in groups for a matcher that takes many pairs at once: the same counts in the same order."""

import threading
from dataclasses import replace

import pytest

from auditor.errors import SettingError
from auditor.measurement import measure, measure_stream
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.model.frames import SkippedFrame
from tests.making.matchers import WholeRange
from tests.making.scenes import plane_frame, plane_rig

RIG = plane_rig((0.6, 0.3, 0.0))
PAIRS = 3  # of three cameras: two in the view of the leftmost, and (S_1, S_2)


class Batching:
    """SGBM that takes many pairs at once, as a network on a GPU does."""

    def __init__(self, pairs_at_once: int) -> None:
        self.pairs_at_once = pairs_at_once
        self.pairs_matched: list[int] = []
        self.threads: set[str] = set()
        self._sgbm = SgbmMatcher()

    def __getattr__(self, name):
        return getattr(self._sgbm, name)

    def match_pairs(self, images, pairs):
        self.pairs_matched.append(len(pairs))
        self.threads.add(threading.current_thread().name)
        return [self._sgbm.match(images[left], images[right]) for left, right in pairs]


def flat(measurement):
    """Everything that was measured, as plain values."""
    cells = {
        counted: {name: grid.tolist() for name, grid in vars(c).items()} for counted, c in measurement.cells.items()
    }
    return vars(measurement) | {"cells": cells}


def frames(count: int, skipped: int | None = None):
    for number in range(count):
        if number == skipped:
            yield SkippedFrame(number, 0, "torn")
        else:
            yield replace(plane_frame(RIG, 8.0 + number, frozenset({1} if number == 4 else ())), number=number)


@pytest.mark.parametrize(("pairs_at_once", "groups"), [(6, [6, 3, 4, 3]), (100, [16]), (2, [3, 3, 3, 1, 3, 3])])
def test_groups_of_frames_are_counted_like_single_ones_and_keep_their_order(pairs_at_once, groups) -> None:
    matcher = Batching(pairs_at_once)
    found = list(measure_stream(frames(7, skipped=2), RIG, matcher))
    plain = [one if isinstance(one, SkippedFrame) else measure(one, RIG, WholeRange()) for one in frames(7, skipped=2)]
    assert [isinstance(one, SkippedFrame) for one in found] == [number == 2 for number in range(7)]
    for one, other in zip(found, plain, strict=True):
        if not isinstance(other, SkippedFrame):
            assert flat(one[0]) == flat(other[0])
    assert sum(matcher.pairs_matched) == 16
    assert [count for count in matcher.pairs_matched if count] == groups
    assert threading.main_thread().name not in matcher.threads


def test_sgbm_sees_frame_after_frame_and_no_thread(monkeypatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", None)
    taken: list[int] = []

    def noted():
        for frame in frames(3):
            taken.append(frame.number)
            yield frame

    stream = measure_stream(noted(), RIG, SgbmMatcher())
    assert next(stream)[0].number == 0
    assert taken == [0]


def test_decoding_goes_on_while_a_group_is_matched() -> None:
    decoded = threading.Event()
    waited: list[bool] = []

    class Slow(Batching):
        def match_pairs(self, images, pairs):
            waited.append(decoded.wait(5))  # until the next group has been decoded
            return super().match_pairs(images, pairs)

    def noted():
        for frame in frames(4):
            if frame.number == 3:
                decoded.set()
            yield frame

    assert len(list(measure_stream(noted(), RIG, Slow(2 * PAIRS)))) == 4
    assert waited == [True, True]


def test_an_error_of_the_matcher_comes_out_and_nothing_is_left_running() -> None:
    class Failing(Batching):
        def match_pairs(self, images, pairs):
            raise SettingError("does not fit")

    before = threading.active_count()
    with pytest.raises(SettingError, match="does not fit"):
        list(measure_stream(frames(9), RIG, Failing(4)))
    assert threading.active_count() == before

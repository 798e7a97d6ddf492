"""Items made in a thread: in order, few at a time, errors in their place, and nothing left running."""

import threading
import time

import pytest

from auditor.measurement.frame import prefetch


def test_items_keep_their_order_and_none_is_lost() -> None:
    assert list(prefetch(range(1000), 3)) == list(range(1000))
    assert list(prefetch([])) == []
    assert list(prefetch([None, 0], 5)) == [None, 0]


def test_the_next_items_are_made_while_one_is_used_but_not_all() -> None:
    made: list[int] = []
    there = threading.Event()

    def items():
        for item in range(10):
            made.append(item)
            if item == 2:
                there.set()
            yield item

    coming = prefetch(items(), 1)
    assert next(coming) == 0
    assert there.wait(5)  # made although only the first one was used
    time.sleep(0.05)
    assert made == [0, 1, 2]
    assert list(coming) == list(range(1, 10))


def test_an_error_comes_in_the_place_of_its_item() -> None:
    def items():
        yield 1
        yield 2
        raise KeyError("third")

    coming = prefetch(items(), 5)
    assert [next(coming), next(coming)] == [1, 2]
    with pytest.raises(KeyError, match="third"):
        next(coming)


def test_leaving_early_closes_the_source_and_ends_the_thread() -> None:
    closed: list[str] = []

    def items():
        try:
            yield from range(10**6)
        finally:
            closed.append(threading.current_thread().name)

    before = threading.active_count()
    coming = prefetch(items(), 2)
    next(coming)
    coming.close()
    assert threading.active_count() == before
    assert closed != []
    assert closed != [threading.main_thread().name]

import os
import signal
from collections.abc import Sequence

import pytest

from auditor.engines import Outcome, Progress, run_all
from auditor.errors import RecordingError


def square(item: int, progress: Progress) -> int:
    progress("squaring", item)
    if item == 3:
        raise RecordingError("cannot be read", where=item)
    if item == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return item * item


def outcomes(items: Sequence[int], jobs: int) -> tuple[dict[int, Outcome[int, int]], list[tuple[int, str, int]]]:
    heard: list[tuple[int, str, int]] = []
    done = {
        o.item: o for o in run_all(square, items, jobs, lambda item, what, count: heard.append((item, what, count)))
    }
    return done, heard


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_has_an_outcome_and_an_error_stays_with_its_item(jobs: int) -> None:
    done, heard = outcomes([1, 2, 3, 5], jobs)
    assert {item: outcome.result for item, outcome in done.items()} == {1: 1, 2: 4, 3: None, 5: 25}
    assert str(done[3].error) == "3: cannot be read"
    assert (2, "squaring", 2) in heard


def test_a_killed_process_loses_its_item_alone() -> None:
    done, _ = outcomes([1, 4, 2, 5, 6], jobs=2)
    assert "its process died" in str(done[4].error)
    assert {item: outcome.result for item, outcome in done.items() if item != 4} == {1: 1, 2: 4, 5: 25, 6: 36}


def stop_at_the_first_progress(item: int, progress: Progress) -> int:
    progress("begun", 0)
    signal.pause()
    return item


def test_an_interrupt_stops_the_workers_and_is_raised() -> None:
    def interrupt(item: int, what: str, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(run_all(stop_at_the_first_progress, [1, 2], 2, interrupt))

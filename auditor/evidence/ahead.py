"""Work that goes on while its results are used: decoding while a network matches, matching while counts are made."""

from collections.abc import Generator, Iterable
from queue import Full, Queue
from threading import Event, Thread
from typing import Generic, TypeVar

Item = TypeVar("Item")

_POLL_S = 0.05


def ahead(items: Iterable[Item], count: int = 1) -> Generator[Item]:
    """The items in their order, made in a thread that is at most `count` of them ahead.

    An error of theirs is raised where its item would have come. Closed early, or left by an error, it ends the thread.
    """
    maker = _Maker(items, count)
    maker.thread.start()
    try:
        while (made := maker.made.get()) is not None:
            yield made[0]
        if maker.error is not None:
            raise maker.error
    finally:
        maker.left.set()
        maker.thread.join()


class _Maker(Generic[Item]):
    """Puts each item into a queue, in a tuple of its own, then None."""

    def __init__(self, items: Iterable[Item], count: int) -> None:
        self.items = items
        self.made: Queue[tuple[Item] | None] = Queue(count)
        self.left = Event()
        self.error: BaseException | None = None
        self.thread = Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        try:
            for item in self.items:
                self._put((item,))
                if self.left.is_set():
                    break
        except BaseException as error:  # noqa: BLE001 - it is raised again where the items are used
            self.error = error
        if isinstance(self.items, Generator):
            self.items.close()  # here, where it runs
        self._put(None)

    def _put(self, made: tuple[Item] | None) -> None:
        while not self.left.is_set():
            try:
                self.made.put(made, timeout=_POLL_S)
            except Full:
                continue
            return

"""What is damaged in a file: a list that stays short, and what may be trusted of a chunk that the file's end cuts."""

from auditor.recordings.recording import Damage

MAX_ENTRIES = 100
_ZEROS = bytes(512)


class DamageLog:
    """Collects Damage; beyond MAX_ENTRIES it only counts. `file` is the one being read, where there are several."""

    def __init__(self) -> None:
        self.file = ""
        self._entries: list[Damage] = []
        self._more = 0

    def add(self, what: str, offset: int | None = None) -> None:
        """Note one more."""
        if len(self._entries) < MAX_ENTRIES:
            self._entries.append(Damage(what, offset, self.file))
        else:
            self._more += 1

    @property
    def count(self) -> int:
        """How many were noted."""
        return len(self._entries) + self._more

    @property
    def entries(self) -> tuple[Damage, ...]:
        """What was noted, the first ones in full."""
        if not self._more:
            return tuple(self._entries)
        return (*self._entries, Damage(f"and {self._more} more damaged places"))


def is_trusted(data: bytes | memoryview) -> bool:
    """True for the data of a whole record without a run of zeros, which a crash may leave where data should be.

    Leaving out too much is no loss here: what is left out was cut, and says so.
    """
    return bytes(data).find(_ZEROS) < 0

"""The damage of a file as a list of bounded length, and the test for records recovered from a cut chunk."""

from auditor.recordings.recording import Damage

MAX_ENTRIES = 100
_ZEROS = bytes(512)


class DamageLog:
    """Collects Damage; beyond MAX_ENTRIES it only counts. `file` names the file being read, where there are several."""

    def __init__(self) -> None:
        self.file = ""
        self._entries: list[Damage] = []
        self._more = 0

    def add(self, what: str, offset: int | None = None) -> None:
        """Note one damaged part."""
        if len(self._entries) < MAX_ENTRIES:
            self._entries.append(Damage(what, offset, self.file))
        else:
            self._more += 1

    @property
    def count(self) -> int:
        """The number of damaged parts noted."""
        return len(self._entries) + self._more

    @property
    def entries(self) -> tuple[Damage, ...]:
        """The damaged parts noted, the first MAX_ENTRIES in full."""
        if not self._more:
            return tuple(self._entries)
        return (*self._entries, Damage(f"and {self._more} more damaged places"))


def is_trusted(data: bytes | memoryview) -> bool:
    """True for the data of a whole record without a run of zeros, which a crash may leave in place of data.

    A record that is wrongly left out is reported as damage, like the rest of the cut chunk.
    """
    return bytes(data).find(_ZEROS) < 0

"""The damage of a file as a list of bounded length, and the test for records recovered from a cut chunk."""

from auditor.recordings.recording import Damage

MAX_ENTRIES = 100
_ZEROS = bytes(512)


class DamageLog:
    """Collects Damage; beyond MAX_ENTRIES it only counts. `of` gives the log of one of several files."""

    def __init__(self, file: str = "", whole: "DamageLog | None" = None) -> None:
        self._file = file
        self._whole = whole or self
        self._entries: list[Damage] = []
        self._more = 0
        self.count = 0
        """The number of damaged parts noted through this log."""

    def of(self, file: str) -> "DamageLog":
        """The log of one file: what is added to it belongs to this log, with the name of the file."""
        return DamageLog(file, self)

    def add(self, what: str, offset: int | None = None) -> None:
        """Note one damaged part."""
        self.count += 1
        self._whole._keep(Damage(what, offset, self._file))

    def _keep(self, damage: Damage) -> None:
        if len(self._entries) < MAX_ENTRIES:
            self._entries.append(damage)
        else:
            self._more += 1

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

"""The base of all recordings that are files: a context manager that closes them, and notices what changes meanwhile."""

from types import TracebackType
from typing import Self

from auditor.recordings.content import Contents


class OpenedRecording:
    """A recording whose files are `contents`. See recording.Recording."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Nothing stays open between reads, unless a format says otherwise."""

    def check_unchanged(self) -> None:
        """Raise ChangedError where a file is not what it was when it was opened."""
        self._contents.check_unchanged()

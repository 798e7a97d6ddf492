"""How much of a recording's files is read."""

import pytest

from auditor.recordings import content


def count_reads(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The bytes of each read from now on."""
    read: list[int] = []
    plain = content._pread

    def counted(descriptor: int, offset: int, length: int) -> bytes:
        read.append(length)
        return plain(descriptor, offset, length)

    monkeypatch.setattr(content, "_pread", counted)
    return read

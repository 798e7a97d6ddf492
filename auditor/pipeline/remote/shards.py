"""Shards: parts of all recordings, each for a process that knows nothing of the others."""

import hashlib
import re
from dataclasses import dataclass

from auditor.errors import SettingError

_SHARD = re.compile(r"(\d{1,6})/(\d{1,6})")
_BYTES = 8


@dataclass(frozen=True)
class Shard:
    """Part `number` of `count`, which are counted from 0: a recording belongs to one of them, by its place alone."""

    number: int
    count: int

    def has(self, place: str) -> bool:
        """Whether the recording at a path or an address belongs to it."""
        digest = hashlib.sha256(place.encode("utf-8", "surrogateescape")).digest()
        return int.from_bytes(digest[:_BYTES]) % self.count == self.number


def shard_of(text: str) -> Shard:
    """The shard that a text such as 0/8 means. Raises SettingError."""
    found = _SHARD.fullmatch(text)
    shard = Shard(int(found[1]), int(found[2])) if found else Shard(0, 0)
    if shard.number >= shard.count:
        raise SettingError(f"{text!r} is no shard", where="--shard", remedy="of eight they are 0/8, 1/8, ... 7/8")
    return shard

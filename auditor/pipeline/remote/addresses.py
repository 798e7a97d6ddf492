"""Addresses of objects: s3://bucket/key, gs://bucket/key, az://container/key, https://host/path."""

import re
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import SettingError

_ADDRESS = re.compile(r"(s3|gs|az|https?)://([^/]*)(?:/(.*))?", re.DOTALL | re.IGNORECASE)
_WILD = re.compile(r"[*?\[]")
_PLACE = re.compile(r"\*\*/|\*\*|\*|\?|\[!?[^\]/]+\]")
_TRANSLATED = {"**/": "(?:[^/]+/)*", "**": ".*", "*": "[^/]*", "?": "[^/]"}


@dataclass(frozen=True)
class Address:
    """An object, a folder of objects, or a pattern of keys: `root` is a bucket, `key` what follows it."""

    root: str
    key: str

    def __str__(self) -> str:
        return f"{self.root}/{self.key}"

    @property
    def scheme(self) -> str:
        """The word before the colon."""
        return self.root.partition(":")[0]

    @property
    def is_pattern(self) -> bool:
        """Whether it stands for the keys that match it; on the web a name stands for itself alone."""
        return not self.scheme.startswith("http") and _WILD.search(self.key) is not None

    @property
    def folder(self) -> str:
        """The keys below which all are that it stands for; empty for all of a bucket."""
        if not self.is_pattern:
            return self.key.rstrip("/")
        plain = self.key[: _WILD.search(self.key).start()]  # type: ignore[union-attr]  # it is a pattern
        return plain.rpartition("/")[0]

    def matches(self, key: str) -> bool:
        """Whether a key is one of a pattern's: `*` stands within a name, `**` for any folders."""
        return re.fullmatch(_expression(self.key), key, re.DOTALL) is not None

    def at(self, key: str) -> str:
        """The address of a key of the same bucket."""
        return f"{self.root}/{key}"


def address_of(text: str | Path) -> Address | None:
    """The address that a text is; None where it is a path. Raises SettingError for one that cannot be used."""
    parts = _ADDRESS.fullmatch(text) if isinstance(text, str) else None
    if parts is None:
        return None
    scheme, host, key = parts[1].lower(), parts[2], parts[3] or ""
    shown = f"{scheme}://{host.rpartition('@')[2]}/..."
    if "@" in host or (scheme.startswith("http") and "?" in key):
        raise SettingError(
            "an address holds no credentials: it is shown, and kept in the store",
            where=shown,
            remedy="give them in the environment (AWS_ACCESS_KEY_ID and its like)",
        )
    if not host:
        raise SettingError("it names no bucket", where=str(text), remedy="write s3://bucket/folder")
    return Address(f"{scheme}://{host}", key)


def path_or_address(text: str | Path) -> "Path | Address":
    """What a person gave as a recording. Raises SettingError for an address that cannot be used."""
    return address_of(text) or Path(text)


def _expression(pattern: str) -> str:
    expression, position = "", 0
    for place in _PLACE.finditer(pattern):
        expression += re.escape(pattern[position : place.start()])
        wild = place[0]
        expression += _TRANSLATED.get(wild) or wild.replace("[!", "[^", 1).replace("\\", r"\\")
        position = place.end()
    return expression + re.escape(pattern[position:])

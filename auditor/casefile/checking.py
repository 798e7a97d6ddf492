"""Checking a case without the store it came from: its folder, or its zip, against its manifest and signature."""

import base64
import hashlib
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Protocol

from auditor.casefile.folder import (
    ENVELOPE,
    MANIFEST,
    PAYLOAD_TYPE,
    PREDICATE_TYPE,
    STATEMENT_TYPE,
    SUMS,
    files_of,
    signed_bytes,
)
from auditor.errors import SettingError
from auditor.recordings.recording import load_json
from auditor.safety.budget import CASE
from auditor.safety.zips import UnsafeZipError, check_tiled, opened
from auditor.store.files import hash_stream
from auditor.store.log.signatures import signs

if TYPE_CHECKING:
    from zipfile import ZipFile

    from auditor.store.log.signatures import PublicKey

_MOST_MANIFEST_BYTES = 16 * 2**20
_BESIDE = frozenset({MANIFEST, ENVELOPE, SUMS})
_REMEDY = "ask whoever wrote it for their zip, or for the folder"


@dataclass(frozen=True)
class CheckedCase:
    """What was found: one sentence a problem, and how many files there are; `signer` is the key's id, if any signed."""

    problems: tuple[str, ...]
    files: int
    signer: str | None


class _Files(Protocol):
    """The files of a case by their paths within it."""

    def names(self) -> list[str]: ...

    def open(self, name: str) -> IO[bytes]: ...


def is_case(path: Path) -> bool:
    """True for a folder with a manifest, and for a zip."""
    return (path / MANIFEST).is_file() or (path.suffix.lower() == ".zip" and path.is_file())


def check_case(path: Path, key: "PublicKey | None" = None) -> CheckedCase:
    """Hash every file of a case and compare it with its manifest; with a key, check that its holder signed it.

    Raises SettingError where it is no case that can be read.
    """
    try:
        if path.is_dir():
            return _checked(path, _Folder(path), key)
        with opened(path, CASE) as archive:
            return _checked(path, _Zip(archive), key)
    except UnsafeZipError as error:
        raise SettingError(f"{error}: it is no case that was written so", where=path, remedy=_REMEDY) from error
    except (OSError, ValueError) as error:
        raise SettingError(f"it is no case that can be read ({error})", where=path) from error


def _checked(path: Path, files: _Files, key: "PublicKey | None") -> CheckedCase:
    names = set(files.names())
    if MANIFEST not in names:
        raise SettingError(f"it is no case: it has no {MANIFEST}", where=path)
    content = _small(files, MANIFEST)
    subjects = _subjects(content, path)
    hashes = {name: _hash(files, name) for name in sorted(names - _BESIDE)}
    problems = [*_differences(subjects, hashes), *_of_sums(files, names, subjects, content)]
    signer, unsigned = _signature(files, names, content, key)
    return CheckedCase((*problems, *unsigned), len(names), signer)


def _subjects(content: bytes, path: Path) -> dict[str, str]:
    """The sha256 of each file that the manifest names. Raises SettingError where it is none."""
    try:
        statement = load_json(content)
        of_case = (statement["_type"], statement["predicateType"]) == (STATEMENT_TYPE, PREDICATE_TYPE)
        named = statement["subject"]
        subjects = {str(one["name"]): str(one["digest"]["sha256"]) for one in named}
        of_case = of_case and len(subjects) == len(named)
    except (KeyError, TypeError, ValueError, RecursionError):
        of_case, subjects = False, {}
    if not of_case:
        remedy = "it was changed, or is of another program"
        raise SettingError(f"its {MANIFEST} is no manifest of a case", where=path, remedy=remedy)
    return subjects


def _differences(subjects: Mapping[str, str], hashes: Mapping[str, str]) -> Iterator[str]:
    for name in sorted(subjects.keys() | hashes.keys()):
        if name not in hashes:
            yield f"{name}: it is missing"
        elif name not in subjects:
            yield f"{name}: it was added: the manifest does not name it"
        elif subjects[name] != hashes[name]:
            yield f"{name}: it is not as it was written"


def _of_sums(files: _Files, names: set[str], subjects: Mapping[str, str], content: bytes) -> Iterator[str]:
    """Whether the lines for sha256sum say the same as the manifest."""
    if SUMS not in names:
        yield f"{SUMS}: it is missing"
        return
    due = {**subjects, MANIFEST: hashlib.sha256(content).hexdigest()}
    if ENVELOPE in names:
        due[ENVELOPE] = _hash(files, ENVELOPE)
    lines = "".join(f"{sha256}  {name}\n" for name, sha256 in sorted(due.items()))
    if _small(files, SUMS) != lines.encode():
        yield f"{SUMS}, {MANIFEST} or {ENVELOPE}: they do not fit together: one of them is not as it was written"


def _signature(
    files: _Files, names: set[str], content: bytes, key: "PublicKey | None"
) -> tuple[str | None, tuple[str, ...]]:
    """Who signed, by the id of the key, and what is wrong with the signature."""
    if ENVELOPE not in names:
        return None, ((f"{ENVELOPE}: nobody signed this case",) if key is not None else ())
    try:
        envelope = load_json(_small(files, ENVELOPE))
        [signature] = envelope["signatures"]
        payload = base64.b64decode(envelope["payload"], validate=True)
        key_id, signed = str(signature["keyid"]), str(signature["sig"])
        if envelope["payloadType"] != PAYLOAD_TYPE or payload != content:
            return None, (f"{ENVELOPE}: what is signed is another manifest than {MANIFEST}",)
    except (KeyError, TypeError, ValueError, RecursionError):
        return None, (f"{ENVELOPE}: it is not as it was written",)
    if key is not None and not signs(key, signed_bytes(payload), signed):
        return key_id, (f"{ENVELOPE}: the holder of this key did not sign it",)
    return key_id, ()


def _small(files: _Files, name: str) -> bytes:
    with files.open(name) as file:
        content = file.read(_MOST_MANIFEST_BYTES + 1)
    if len(content) > _MOST_MANIFEST_BYTES:
        raise ValueError(f"{name} is too large")
    return content


def _hash(files: _Files, name: str) -> str:
    with files.open(name) as file:
        return hash_stream(file)[1]


class _Folder:
    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def names(self) -> list[str]:
        """All files; a link is one that was added, whatever it leads to, a file or a folder."""
        links = (path for path in self._folder.rglob("*") if path.is_symlink())
        return sorted({*files_of(self._folder), *(path.relative_to(self._folder).as_posix() for path in links)})

    def open(self, name: str) -> IO[bytes]:
        path = self._folder / name
        return io.BytesIO() if path.is_symlink() or not path.is_file() else path.open("rb")


class _Zip:
    """The files lie in one folder of the archive, and nothing lies beside it."""

    def __init__(self, archive: "ZipFile") -> None:
        check_tiled(archive)
        self._archive = archive
        folders = {name.partition("/")[0] for name in archive.namelist()}
        if len(folders) != 1:
            raise UnsafeZipError("its members do not lie in one folder")
        [self._folder] = folders

    def names(self) -> list[str]:
        whole = (member.filename for member in self._archive.infolist() if not member.is_dir())
        return sorted(name.removeprefix(f"{self._folder}/") for name in whole)

    def open(self, name: str) -> IO[bytes]:
        return self._archive.open(f"{self._folder}/{name}")

"""Folders and files that appear whole or not at all, for their owner alone."""

import base64
import hashlib
import json
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from auditor.errors import SettingError, refused
from auditor.store.files import close_to_others, for_owner
from auditor.store.log.signatures import SigningKey


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A place beside the target; what is there at the end gets the target's name, and after an error nothing stays.

    Raises SettingError where the target exists, or cannot be written.
    """
    place = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
    try:
        if target.exists() or target.is_symlink():
            raise SettingError("it exists already", where=target, remedy="choose another name, or remove it")
        yield place
        place.rename(target)
    except OSError as error:
        raise SettingError(
            f"it cannot be written ({error.strerror or error})", where=target, remedy=refused(error)
        ) from error
    finally:
        if place.is_dir():
            shutil.rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)


@contextmanager
def new_folder(target: Path) -> Iterator[Path]:
    """A folder to write to, which becomes the target at the end. Raises SettingError as `_beside` does."""
    with _beside(target) as folder:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(0o700)
        yield folder
        close_to_others(folder)


@contextmanager
def new_file(target: Path) -> Iterator[Path]:
    """The same for a file."""
    with _beside(target) as file:
        file.touch(0o600)
        yield file


def write_file(path: Path, content: bytes) -> None:
    """Write a file for its owner alone, and the folders that it needs. Raises OSError."""
    path.parent.mkdir(0o700, parents=True, exist_ok=True)
    with open(path, "xb", opener=for_owner) as file:
        file.write(content)


MANIFEST, ENVELOPE, SUMS = "manifest.json", "manifest.dsse.json", "SHA256SUMS"
STATEMENT_TYPE = "https://in-toto.io/Statement/v1"
PREDICATE_TYPE = "urn:auditor:case:1"
PAYLOAD_TYPE = "application/vnd.in-toto+json"


def write_manifest(folder: Path, predicate: Mapping[str, Any], key: SigningKey | None) -> None:
    """Write the manifest of all files of a case, the last ones that are written. Raises OSError."""
    subjects = [
        {
            "name": name,
            "digest": {"sha256": sha256_of(folder / name)},
            "annotations": {"size": (folder / name).stat().st_size},
        }
        for name in files_of(folder)
    ]
    statement = {
        "_type": STATEMENT_TYPE,
        "subject": subjects,
        "predicateType": PREDICATE_TYPE,
        "predicate": dict(predicate),
    }
    content = (json.dumps(statement, indent=1, allow_nan=False) + "\n").encode()
    write_file(folder / MANIFEST, content)
    if key is not None:
        write_file(folder / ENVELOPE, _envelope(content, key))
    lines = [f"{sha256_of(folder / name)}  {name}\n" for name in files_of(folder)]
    write_file(folder / SUMS, "".join(lines).encode())


def files_of(folder: Path) -> list[str]:
    """The paths of all files of a folder within it, sorted."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())


def sha256_of(path: Path) -> str:
    """The sha256 (hex) of a file. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def signed_bytes(payload: bytes) -> bytes:
    """What is signed of a payload: DSSE's encoding of it and of its type."""
    return b"DSSEv1 %d %s %d %s" % (len(PAYLOAD_TYPE), PAYLOAD_TYPE.encode(), len(payload), payload)


def _envelope(payload: bytes, key: SigningKey) -> bytes:
    envelope = {
        "payloadType": PAYLOAD_TYPE,
        "payload": base64.b64encode(payload).decode(),
        "signatures": [{"keyid": key.key_id, "sig": key.sign(signed_bytes(payload))}],
    }
    return (json.dumps(envelope, indent=1) + "\n").encode()

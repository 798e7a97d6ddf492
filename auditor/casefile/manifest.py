"""The manifest of a case: an in-toto statement over all its files, the same as lines for sha256sum, and a signature.

`manifest.json` is the statement; `manifest.dsse.json` holds it signed, as in-toto's tools read it; `SHA256SUMS` has a
line for each file but itself, so that `sha256sum -c SHA256SUMS` checks a case without this program.
"""

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from auditor.casefile.folder import write_file
from auditor.store.log.signatures import SigningKey

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

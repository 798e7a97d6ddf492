"""Signatures of the heads of a store's chains by Ed25519: they cover every entry, and so every file.

Keys are PEM files, as `openssl genpkey -algorithm ed25519` makes them.
"""

import base64
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.errors import SettingError, needing
from auditor.model.canonical import canonical_json
from auditor.store.log.chains import LOG, Chain
from auditor.store.log.entry import Entry, EntryKind

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    PublicKey = Ed25519PublicKey

KEY_VARIABLE = "AUDITOR_SIGNING_KEY"
"""The environment variable that may name the file of a private key: then every run signs at its end."""

Signer = Callable[[Mapping[str, str]], str]
"""Signs heads, the hashes of the last entries by chain; gives the signature in base64."""

_FORMAT = "auditor heads 1"


def signer_of(key: Path | None) -> Signer | None:
    """Signs by the private key of a file, or of the one that the environment names; None without any.

    Raises SettingError where it cannot be read, is none, or the package for it is missing.
    """
    given = signing_key(key)
    return (lambda heads: given.sign(_signed(heads))) if given is not None else None


@dataclass(frozen=True)
class SigningKey:
    """A private key: `sign` gives the signature of bytes in base64, `key_id` is the sha256 (hex) of its public key."""

    sign: Callable[[bytes], str]
    key_id: str


def signing_key(key: Path | None) -> SigningKey | None:
    """The private key of a file, or of the one that the environment names; None without any. Raises SettingError."""
    named = os.environ.get(KEY_VARIABLE)
    path = key if key is not None else Path(named) if named else None
    if path is None:
        return None
    with needing("signatures need", "signing"):
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415 - an extra
        from cryptography.hazmat.primitives.serialization import load_pem_private_key  # noqa: PLC0415
    try:
        private = load_pem_private_key(path.read_bytes(), password=None)
    except (OSError, ValueError, TypeError) as error:
        raise SettingError(f"it is no private key that can be read ({error})", where=path, remedy=_HOW) from error
    if not isinstance(private, Ed25519PrivateKey):
        raise SettingError("it is no Ed25519 key", where=path, remedy=_HOW)
    key_id = hashlib.sha256(private.public_key().public_bytes_raw()).hexdigest()
    return SigningKey(lambda content: base64.b64encode(private.sign(content)).decode(), key_id)


_HOW = "openssl genpkey -algorithm ed25519 -out private.pem makes one"


def public_key(path: Path) -> "Ed25519PublicKey":
    """The public key of a PEM file. Raises SettingError."""
    with needing("signatures need", "signing"):
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey  # noqa: PLC0415 - an extra
        from cryptography.hazmat.primitives.serialization import load_pem_public_key  # noqa: PLC0415
    remedy = "openssl pkey -in private.pem -pubout -out public.pem makes it from a private key"
    try:
        key = load_pem_public_key(path.read_bytes())
    except (OSError, ValueError) as error:
        raise SettingError(f"it is no public key that can be read ({error})", where=path, remedy=remedy) from error
    if not isinstance(key, Ed25519PublicKey):
        raise SettingError("it is no Ed25519 key", where=path, remedy=remedy)
    return key


def unsigned(chains: Sequence[Chain], key: "Ed25519PublicKey") -> Iterator[tuple[str, str]]:
    """Places in the store, each with what of it the holder of a key did not sign."""
    signed = {entry.sha256: entry for chain in chains for entry in chain.entries if _is_signed(entry, key)}
    covered = {(name, head) for entry in signed.values() for name, head in entry.what["heads"].items()}
    if not signed:
        yield LOG, "nothing in it is signed by this key"
        return
    for chain in chains:
        behind = 0
        for entry in reversed(chain.entries):
            if (chain.name, entry.sha256) in covered:
                break
            behind += entry.sha256 not in signed
        if behind:
            yield f"{LOG}/{chain.name}.jsonl", f"its last {behind} entries are not signed by this key"


def _is_signed(entry: Entry, key: "Ed25519PublicKey") -> bool:
    if entry.kind != EntryKind.SIGNED:
        return False
    try:
        return signs(key, _signed(entry.what["heads"]), entry.what["signature"])
    except (KeyError, TypeError):
        return False


def signs(key: "Ed25519PublicKey", content: bytes, signature: str) -> bool:
    """Whether a signature, in base64, is that of some bytes by the holder of a key."""
    from cryptography.exceptions import InvalidSignature  # noqa: PLC0415 - an extra

    try:
        key.verify(base64.b64decode(signature), content)
    except (InvalidSignature, ValueError):
        return False
    return True


def _signed(heads: Mapping[str, str]) -> bytes:
    return canonical_json({"format": _FORMAT, "heads": dict(heads)}).encode()

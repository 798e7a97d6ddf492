"""Objects of S3, Google Cloud Storage, Azure and the web: listed, and read from their beginning to their end.

Credentials and endpoint come from the environment, as for other tools: AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL, AWS_REGION
and their like, the role of a container or machine, and profiles where boto3 is installed. What a server answers is
never shown whole: it may repeat what was signed.
"""

import os
import random
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

from auditor.errors import AuditorError, RecordingError, SettingError, needing
from auditor.pipeline.remote.addresses import Address
from auditor.recordings.location import StoredObject

if TYPE_CHECKING:
    from obstore.store import ObjectStore

Answer = TypeVar("Answer")

Written = Mapping[str, str]
"""What a server says of one writing of an object: S3 and Azure know it by its ETag, Google by its version."""

_PIECE_BYTES = 64 << 20
_PIECE_S = 300
"""A request is for so much at most, and has so much time: a connection that hangs is cut."""

_CHUNK_BYTES = 128 << 10
"""So much is lost at most where a connection is cut."""

_MOST_FAILURES = 8
"""Failures in a row without a byte between them."""

_RETRIES, _RETRYING_S = 6, 60
"""Of one request, by the library, with waits that become longer."""

_FIRST_WAIT_S, _LONGEST_WAIT_S = 0.1, 10.0
_KEYS_A_PAGE = 1000

_STATUS = re.compile(r"status(?: code)?: ([45]\d\d)")
_CODE = re.compile(r"<Code>(\w{1,60})</Code>")
_ENDPOINTS = {
    "s3": ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT"),
    "gs": ("GOOGLE_BASE_URL",),
    "az": ("AZURE_STORAGE_ENDPOINT", "AZURE_ENDPOINT"),
}
"""Variables that say where another server is."""

_LOST = ("169.254.", "metadata.google.internal")
"""Where credentials are looked for last: on the machines of a cloud."""


def list_objects(address: Address) -> Iterator[StoredObject]:
    """The objects below the folder of an address, page by page. Raises RecordingError and SettingError."""
    api, store = _library(), _store(address.root)
    last, tries = None, _Tries()
    while True:
        with tries.one(str(address)):
            for page in api.list(store, address.folder or None, offset=last, chunk_size=_KEYS_A_PAGE):
                for entry in page:
                    yield _described(address, entry)
                    last = entry["path"]
                    tries.got_on()
            return


def find_object(address: Address) -> StoredObject | None:
    """The object of just this key; None where there is none. Raises RecordingError and SettingError."""
    api, store = _library(), _store(address.root)
    if not address.key or address.key.endswith("/"):
        return None
    with suppress(NoObjectError):
        return _described(address, _asked(str(address), lambda: api.head(store, address.key)))
    return None


def read_small(address: Address) -> tuple[bytes, Written] | None:
    """The content of a small object, and what is known of its writing; None where there is none.

    Raises RecordingError and SettingError.
    """

    def read() -> tuple[bytes, Written]:
        response = _library().get(_store(address.root), address.key)
        return bytes(response.bytes()), {
            name: value for name in ("e_tag", "version") if (value := response.meta.get(name))
        }

    with suppress(NoObjectError):
        return _asked(str(address), read)
    return None


def replace_small(address: Address, content: bytes, before: Written | None) -> bool:
    """Put a small object in the place of the one that was read, or where there is none.

    False where somebody else was faster, or where it was put and nobody said so: who asks again finds it there. Raises
    RecordingError and SettingError.
    """
    mode: Any = "create" if before is None else dict(before)

    def replaced() -> bool:
        try:
            _library().put(_store(address.root), address.key, content, mode=mode, use_multipart=False)
        except Exception as error:
            if type(error).__name__ in {"AlreadyExistsError", "PreconditionError", "FileExistsError"}:
                return False
            raise
        return True

    return _asked(str(address), replaced)


def put_object(address: Address, file: Path) -> None:
    """Put a file in the place of an object. Raises RecordingError and SettingError."""
    _asked(str(address), lambda: _library().put(_store(address.root), address.key, file))


def remove_object(address: Address) -> None:
    """Remove an object; one that is gone is none. Raises RecordingError and SettingError."""
    with suppress(NoObjectError), _reporting(str(address)):
        _library().delete(_store(address.root), address.key)


def copy_object(root: str, stored_object: StoredObject, into: Path, stopped: threading.Event) -> None:
    """Copy an object to a new file, from its beginning to its end.

    Where a request fails, or is cut, what follows is asked for, after a while that becomes longer; an object that was
    replaced meanwhile is refused. Raises RecordingError and SettingError.
    """
    _library()
    try:
        with into.open("xb") as file:
            _copy(root, stored_object, file, stopped)
    except OSError as error:
        raise RecordingError(
            f"its copy cannot be written to {into.parent} ({error.strerror or error})",
            where=stored_object.address,
            remedy="make room there, or name another folder with --spool",
        ) from error


def _copy(root: str, stored_object: StoredObject, file: BinaryIO, stopped: threading.Event) -> None:
    tries = _Tries(stopped.wait)
    while file.tell() < stored_object.size_bytes:
        _refuse_stopped(stored_object, stopped)
        with tries.one(stored_object.address):
            for chunk in _chunks(root, stored_object, file.tell()):
                file.write(chunk)
                tries.got_on()
                _refuse_stopped(stored_object, stopped)


def _chunks(root: str, stored_object: StoredObject, begin: int) -> Iterator[Any]:
    """What an object holds from a place on, for one piece at most. Raises what the library raises."""
    end = min(stored_object.size_bytes, begin + _PIECE_BYTES)
    options: dict[str, Any] = {"if_match": stored_object.etag} if stored_object.etag else {}
    if (begin, end) != (0, stored_object.size_bytes):
        options["range"] = (begin, end)
    response = _library().get(_store(root), stored_object.address.removeprefix(f"{root}/"), options=options)
    yield from response.stream(min_chunk_size=_CHUNK_BYTES)


def _refuse_stopped(stored_object: StoredObject, stopped: threading.Event) -> None:
    if stopped.is_set():
        raise RecordingError("its copying was interrupted", where=stored_object.address)


def _asked(where: str, ask: Callable[[], Answer]) -> Answer:
    """The answer to a small request, which is asked again where it fails or is cut. Raises RecordingError."""
    tries = _Tries()
    while True:
        with tries.one(where):
            return ask()


class _Tries:
    """Requests for one thing: a failure is waited for, longer each time, until there are too many in a row."""

    def __init__(self, wait: Callable[[float], object] = time.sleep) -> None:
        self._wait, self._failures = wait, 0

    @contextmanager
    def one(self, where: str) -> Iterator[None]:
        """One try: what may pass is waited for at its end. Raises RecordingError for the rest, and for the last one."""
        try:
            with _reporting(where):
                yield
        except PassingError:
            self._failures += 1
            if self._failures >= _MOST_FAILURES:
                raise
            longest: float = min(_LONGEST_WAIT_S, _FIRST_WAIT_S * 2**self._failures)
            self._wait(longest * random.uniform(0.5, 1.0))  # noqa: S311 - drawn, so that many do not ask at one moment

    def got_on(self) -> None:
        """Something came: failures from here on are new ones."""
        self._failures = 0


# What the library does not know


class NoObjectError(RecordingError):
    """There is no such object, or no such bucket."""


class PassingError(RecordingError):
    """A failure that may pass: a server that is busy, a connection that was cut."""


def _library() -> Any:  # noqa: ANN401 - a module
    """The library for object stores. Raises SettingError where it is not installed."""
    with needing("addresses need", "cloud", "s3://"):
        import obstore  # noqa: PLC0415 - an extra
    return obstore


@cache
def _store(root: str) -> "ObjectStore":
    """The bucket of an address. Raises SettingError."""
    _library()
    from obstore.store import from_url  # noqa: PLC0415 - an extra

    how: dict[str, Any] = _profile() if root.startswith("s3://") else {}
    how["retry_config"] = {"max_retries": _RETRIES, "retry_timeout": timedelta(seconds=_RETRYING_S)}
    how["client_options"] = {"timeout": timedelta(seconds=_PIECE_S), "allow_http": _allows_http(root)}
    try:
        return from_url(root, **how)
    except Exception as error:  # its own errors have no common class that says so
        raise SettingError(
            f"the object store cannot be set up ({type(error).__name__})",
            where=root,
            remedy=f"{_variables(root)}; AWS_ENDPOINT_URL and AWS_REGION say where S3 is",
        ) from error


def _allows_http(root: str) -> bool:
    """An endpoint that is named without TLS is wanted so."""
    named = (os.environ.get(name, "") for name in _ENDPOINTS.get(root.partition(":")[0], ()))
    return root.startswith("http://") or next(filter(None, named), "").startswith("http://")


def _profile() -> dict[str, Any]:
    """Credentials of the user's profiles, where the environment has none and boto3 is installed to read them."""
    credentials = Path(os.environ.get("AWS_SHARED_CREDENTIALS_FILE", "~/.aws/credentials")).expanduser()
    if "AWS_ACCESS_KEY_ID" in os.environ or not (credentials.is_file() or "AWS_PROFILE" in os.environ):
        return {}
    try:
        from boto3 import Session  # noqa: PLC0415 - not everybody has it
        from obstore.auth.boto3 import Boto3CredentialProvider  # noqa: PLC0415
    except ModuleNotFoundError:
        return {}
    return {"credential_provider": Boto3CredentialProvider(Session())}


def _described(address: Address, entry: Mapping[str, Any]) -> StoredObject:
    etag = entry.get("e_tag")
    if etag and not etag.endswith('"'):
        etag = f'"{etag}"'  # listings of Azure leave the quotes out
    return StoredObject(address.at(entry["path"]), entry["size"], etag, entry["last_modified"].isoformat())


@contextmanager
def _reporting(where: str) -> Iterator[None]:
    """Turn what the library raises inside the block into a RecordingError."""
    try:
        yield
    except AuditorError:
        raise
    except Exception as error:
        own_file = isinstance(error, OSError) and error.errno is not None
        if own_file or not (isinstance(error, OSError) or type(error).__module__.startswith("obstore")):
            raise
        raise _told(error, where) from None  # the cause has what the server said


def _told(error: Exception, where: str) -> RecordingError:
    """What went wrong, by its kind, and by the code that the server gave."""
    text, kind = str(error), type(error).__name__
    said = " ".join(code[1] for pattern in (_STATUS, _CODE) if (code := pattern.search(text)))
    said = f" ({said})" if said else ""
    if kind in {"NotFoundError", "FileNotFoundError"} or "404" in said:
        problem = "there is no such bucket" if "NoSuchBucket" in said else "there is no such object"
        return NoObjectError(problem, where=where, remedy="check the address")
    if kind in {"PermissionDeniedError", "UnauthenticatedError", "PermissionError"} or any(
        one in said for one in ("401", "403")
    ):
        return RecordingError(f"access was refused{said}", where=where, remedy=_variables(where))
    if any(place in text for place in _LOST):
        return RecordingError("there are no credentials for it", where=where, remedy=_variables(where))
    if kind == "PreconditionError":
        return RecordingError(
            "the object was replaced while it was read: nothing of this is kept",
            where=where,
            remedy="scan it again when it is finished",
        )
    if kind in {"InvalidPathError", "NotSupportedError"}:
        return RecordingError(f"it cannot be read ({kind})", where=where, remedy="check the address")
    return PassingError(
        f"the object store failed or could not be reached{said}", where=where, remedy="run the command again to go on"
    )


def _variables(where: str) -> str:
    """Where credentials for an address are looked for."""
    if where.startswith("http"):
        return "files of a web server have to be public"
    named = {"gs": "GOOGLE_APPLICATION_CREDENTIALS", "az": "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY"}
    variables = named.get(where.partition(":")[0], "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY")
    return f"give credentials in the environment: {variables}, or a role"

"""Recordings and a store on Google Cloud Storage, whose objects are replaced by their generation."""

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

import pytest

from auditor.cli import run
from auditor.pipeline.remote import object_store as objects
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.snapshots import read_snapshot, replace_snapshot
from tests.making.small_drives import THREE_CAMERAS, write_drive

_DATE, _LISTED = "Sun, 01 Mar 2026 00:00:00 GMT", "2026-03-01T00:00:00Z"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    objects: dict[str, tuple[int, bytes]]
    lock: threading.Lock

    def log_message(self, *_: object) -> None:
        """Be quiet."""

    def _answer(self, status: int, content: bytes = b"", **headers: str) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def _key(self) -> str:
        return unquote(urlsplit(self.path).path).removeprefix("/").partition("/")[2]

    def do_PUT(self) -> None:
        content, wanted = (
            self.rfile.read(int(self.headers["Content-Length"])),
            self.headers["x-goog-if-generation-match"],
        )
        with self.lock:
            generation = self.objects.get(self._key(), (0, b""))[0]
            met = wanted is None or int(wanted) == generation
            if met:
                self.objects[self._key()] = (generation + 1, content)
        if met:
            self._answer(200, ETag=_etag(content), x_goog_generation=str(generation + 1))
        else:
            self._answer(412)

    def do_GET(self) -> None:
        key = self._key()
        if not key:
            self._answer(200, self._listing())
        elif key not in self.objects:
            self._answer(404)
        else:
            self._give(*self.objects[key])

    do_HEAD = do_GET

    def do_DELETE(self) -> None:
        self._answer(204 if self.objects.pop(self._key(), None) else 404)

    def _give(self, generation: int, content: bytes) -> None:
        known = {"ETag": _etag(content), "x_goog_generation": str(generation), "Last_Modified": _DATE}
        if self.headers["If-Match"] not in {None, _etag(content)}:
            self._answer(412)
        elif part := self.headers["Range"]:
            begin, end = map(int, part.removeprefix("bytes=").split("-"))
            end = min(end, len(content) - 1)
            known["Content_Range"] = f"bytes {begin}-{end}/{len(content)}"
            self._answer(206, content[begin : end + 1], **known)
        else:
            self._answer(200, content, **known)

    def _listing(self) -> bytes:
        prefix = parse_qs(urlsplit(self.path).query).get("prefix", [""])[0]
        found = "".join(
            f"<Contents><Key>{escape(key)}</Key><Size>{len(content)}</Size><ETag>{escape(_etag(content))}</ETag>"
            f"<LastModified>{_LISTED}</LastModified></Contents>"
            for key, (_, content) in sorted(self.objects.items())
            if key.startswith(prefix)
        )
        return f"<ListBucketResult>{found}</ListBucketResult>".encode()


def _etag(content: bytes) -> str:
    return f'"{hashlib.sha256(content).hexdigest()[:32]}"'


@contextmanager
def google_store() -> Iterator[tuple[str, dict[str, tuple[int, bytes]]]]:
    """The URL of a server whose buckets share the objects beside it, each with its generation."""
    objects: dict[str, tuple[int, bytes]] = {}
    handler = type("Handler", (_Handler,), {"objects": objects, "lock": threading.Lock()})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}", objects
        server.shutdown()


Held = dict[str, tuple[int, bytes]]


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Held]:
    with google_store() as (url, content):
        monkeypatch.setenv("GOOGLE_BASE_URL", url)
        monkeypatch.setenv("GOOGLE_BEARER_TOKEN", "not-a-token")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        objects._store.cache_clear()
        yield content
        objects._store.cache_clear()


def test_of_two_writers_at_once_the_second_one_is_told(held: Held) -> None:
    address = Address("gs://bucket", "audit")
    nothing = read_snapshot(address)
    assert replace_snapshot(address, nothing, {"a": (1, "x")})
    assert not replace_snapshot(address, nothing, {"b": (1, "y")}), "somebody else made the first one"
    first = read_snapshot(address)
    assert replace_snapshot(address, first, {"a": (1, "x"), "c": (1, "z")})
    assert not replace_snapshot(address, first, {"d": (1, "y")}), "somebody else replaced it"
    assert read_snapshot(address).files == {"a": (1, "x"), "c": (1, "z")}


def test_recordings_there_are_scanned_into_a_store_there_that_is_asked_and_verified(
    held: Held, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    drive = write_drive(tmp_path / "alder.mcap", 3, positions_m=THREE_CAMERAS)
    held["fleet/alder/alder.mcap"] = (1, drive.read_bytes())
    store, found = ["--store", "gs://bucket/audit"], "gs://bucket/fleet/**/*.mcap"
    assert run(["scan", found, *store, "--shard", "0/1", "--jobs", "1"]) == 0
    assert run(["scan", found, *store, "--jobs", "1", "--pictures", "none"]) in {0, 3}
    assert "3 frames measured" in capfd.readouterr().err
    assert run(["query", "summary", *store]) == 0
    assert "alder.mcap" in capfd.readouterr().out
    assert run(["verify", "gs://bucket/audit"]) == 0

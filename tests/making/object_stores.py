"""An object store of the test: moto's server, behind a proxy that counts bytes, refuses requests and cuts answers."""

import http.client
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from subprocess import DEVNULL, Popen
from sys import executable

import boto3
import pytest
from botocore.exceptions import BotoCoreError, ClientError

from auditor.pipeline.remote import object_store as objects

KEY, SECRET = "AKIATHISISNOTAKEY", "a-secret-that-must-not-be-seen"
BUCKET = "fleet"


@dataclass
class Proxy:
    """What stands between the program and the server; `failing` is the share of requests that fail or are cut."""

    port: int
    server_port: int
    failing: float = 0.0
    refusing: bool = False
    given_bytes: int = 0
    requests: list[str] = field(default_factory=list)
    drawn: random.Random = field(default_factory=lambda: random.Random(1))
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def forget(self) -> None:
        self.given_bytes, self.requests = 0, []

    def client(self):
        """A client of the server itself, past the proxy."""
        return boto3.client(
            "s3",
            endpoint_url=f"http://127.0.0.1:{self.server_port}",
            aws_access_key_id=KEY,
            aws_secret_access_key=SECRET,
            region_name="us-east-1",
        )

    def put(self, key: str, file: Path, bucket: str = BUCKET) -> str:
        self.client().upload_file(str(file), bucket, key)
        return f"s3://{bucket}/{key}"


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    proxy: Proxy

    def log_message(self, *_: object) -> None:
        """Be quiet."""

    def _pass(self) -> None:
        proxy, body = self.proxy, self.rfile.read(int(self.headers.get("Content-Length") or 0))
        with proxy.lock:
            proxy.requests.append(f"{self.command} {self.path}")
            fails, cut = proxy.drawn.random() < proxy.failing, proxy.drawn.random() < 0.5
        if (fails and not cut) or proxy.refusing:
            self.send_response(403 if proxy.refusing else 503, "No")
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        upstream = http.client.HTTPConnection("127.0.0.1", proxy.server_port)
        upstream.request(self.command, self.path, body, dict(self.headers))
        answer = upstream.getresponse()
        content = answer.read()
        upstream.close()
        self.send_response_only(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in {"transfer-encoding", "connection", "content-length"}:
                self.send_header(name, value)
        self.send_header("Content-Length", answer.headers["Content-Length"] or str(len(content)))
        self.end_headers()
        if fails:
            content = content[: len(content) // 2]
            self.close_connection = True
        with proxy.lock:
            proxy.given_bytes += len(content) if self.command == "GET" and "list-type" not in self.path else 0
        self.wfile.write(content)

    do_GET = do_PUT = do_HEAD = do_POST = do_DELETE = _pass


@contextmanager
def object_store() -> Iterator[Proxy]:
    """A bucket with nothing in it."""
    handler = type("Handler", (_Handler,), {})
    front = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    free = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    port = free.server_address[1]
    free.server_close()
    server = Popen([executable, "-m", "moto.server", "-p", str(port)], stdout=DEVNULL, stderr=DEVNULL)
    proxy = handler.proxy = Proxy(front.server_address[1], port)
    threading.Thread(target=front.serve_forever, daemon=True).start()
    try:
        while True:
            assert server.poll() is None, "moto's server ended"
            try:
                proxy.client().create_bucket(Bucket=BUCKET)
                break
            except (BotoCoreError, ClientError):
                time.sleep(0.1)
        yield proxy
    finally:
        front.shutdown()
        front.server_close()
        server.terminate()
        server.wait()


def begin_with(monkeypatch: pytest.MonkeyPatch, proxy: Proxy) -> Proxy:
    """The object store of the environment, with which nothing is wrong yet."""
    _name_in_environment(monkeypatch, proxy)
    objects._store.cache_clear()
    monkeypatch.setattr(objects, "_FIRST_WAIT_S", 0.001)
    proxy.failing, proxy.refusing = 0.0, False
    proxy.forget()
    return proxy


def _name_in_environment(monkeypatch: pytest.MonkeyPatch, proxy: Proxy) -> None:
    """Let the environment say where the object store is, and who asks."""
    for name in ("AWS_PROFILE", "AWS_SESSION_TOKEN", "AWS_ENDPOINT_URL_S3"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("AWS_ENDPOINT_URL", proxy.url)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", KEY)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
    monkeypatch.setenv("AWS_REGION", "us-east-1")

"""What libraries for object stores cost: `python -m tests.benchmarks.object_stores`, with s3fs where it is installed.

CPU seconds to import one, and to read an object from its beginning to its end, each in a process of its own; and what
it takes on disk with all that it needs. The server is a process beside them that sends zeros; its time does not count.
"""

import re
import subprocess
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.metadata import PackageNotFoundError, distribution
from statistics import median
from threading import Thread

OBJECT_BYTES = 64 << 20
READS = 6
ROUNDS = 3

_READ = {
    "obstore": """
import obstore
from obstore.store import S3Store
imported = time.process_time()
store = S3Store("b", endpoint=sys.argv[1], client_options={"allow_http": True})
for _ in range(READS):
    total += sum(len(chunk) for chunk in obstore.get(store, "big").stream(min_chunk_size=1 << 17))
""",
    "s3fs": """
import s3fs
imported = time.process_time()
files = s3fs.S3FileSystem(endpoint_url=sys.argv[1])
for _ in range(READS):
    with files.open("b/big", "rb", block_size=8 << 20, cache_type="readahead") as file:
        while chunk := file.read(1 << 20):
            total += len(chunk)
""",
}
_BEFORE = f"""
import os, sys, time
os.environ.update(AWS_ACCESS_KEY_ID="a", AWS_SECRET_ACCESS_KEY="b", AWS_REGION="us-east-1")
READS, total, begun = {READS}, 0, time.process_time()
"""
_AFTER = "print(imported - begun, (time.process_time() - imported) / total * 1e9)"


class _Zeros(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None:
        """Be quiet."""

    def _answer(self) -> None:
        asked = re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        first, last = 0, OBJECT_BYTES - 1
        if asked:
            first, last = int(asked[1]), min(last, int(asked[2] or last))
        self.send_response(206 if asked else 200)
        for name, value in {
            "Content-Length": str(last - first + 1),
            "Content-Range": f"bytes {first}-{last}/{OBJECT_BYTES}",
            "ETag": '"one"',
            "Last-Modified": "Wed, 21 Oct 2015 07:28:00 GMT",
            "Content-Type": "application/octet-stream",
        }.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(bytes(last - first + 1))

    do_GET = do_HEAD = _answer


def installed_bytes(name: str, known: set[str] | None = None) -> int:
    """The files of a package and of those that it needs."""
    known = set() if known is None else known
    if name in known:
        return 0
    known.add(name)
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return 0
    needs = [re.match(r"[\w.-]+", one)[0] for one in found.requires or () if "extra ==" not in one]
    own = sum(file.size or 0 for file in found.files or ())
    return own + sum(installed_bytes(one, known) for one in needs)


def main() -> None:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Zeros)
    Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_address[1]}"
    for name, read in _READ.items():
        if not installed_bytes(name):
            print(f"{name} is not installed")
            continue
        program = _BEFORE + read + _AFTER
        rounds = [
            [
                float(word)
                for word in subprocess.run(
                    [sys.executable, "-c", program, url], capture_output=True, text=True, check=True
                ).stdout.split()
            ]
            for _ in range(ROUNDS)
        ]
        importing, reading = (median(one) for one in zip(*rounds, strict=True))
        print(
            f"{name}: {importing:.2f} CPU s to import, {reading:.2f} CPU ms a MB, "
            f"{installed_bytes(name) / 1e6:.0f} MB installed"
        )
    server.shutdown()


if __name__ == "__main__":
    main()

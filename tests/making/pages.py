"""Pages read as HTML, and opened in a real browser where there is one."""

import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser

HOSTILE = "<script>alert(1)</script>\"' onload=x {{ 7 * 7 }} \u202e"
VOID = {"meta", "img", "br"}
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-logging=stderr",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # nothing leaves this machine
]


class Page(HTMLParser):
    """The elements, attributes and text of a page, which it checks to be well nested."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.text = [], [], ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.text += " " if tag in {"td", "th", "dt", "dd", "small", "p"} else ""
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.text += data

    @property
    def words(self):
        return " ".join(self.text.split())


def browse(page, folder):
    """The lines of the browser's console, the addresses that the page requests, and its document."""
    log = folder / "net.json"
    command = [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}", "--dump-dom"]
    done = subprocess.run(
        [*command, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "LANG": "C"},
    )
    events = json.loads(log.read_text("utf-8"))["events"]
    # The browser's own requests have no origin; those of a page have one.
    requests = [event["params"] for event in events if "initiator" in event.get("params", {})]
    addresses = [params["url"] for params in requests if params["initiator"] != "not an origin"]
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line], addresses, done.stdout


def measured_widths(pages, folder, width_px):
    """How wide pages are on a screen of that width, as one browser measures them; their own policy is taken out."""
    for number, page in enumerate(pages):
        text = re.sub(r"<meta http-equiv=[^>]*>", "", page.read_text("utf-8"))
        told = f"'{number}:'+document.documentElement.scrollWidth"
        ask = f"<script>onload=()=>parent.postMessage({told},'*')</script></body>"
        (folder / f"page{number}.html").write_text(text.replace("</body>", ask), "utf-8")
    # a window is never narrower than 500 px: a frame is
    frame = "<iframe width={} height=800 style='border:0' src=page{}.html></iframe>"
    frames = "".join(frame.format(width_px, number) for number in range(len(pages)))
    told = "<script>document.title='wide';onmessage=e=>document.title+=' '+e.data</script>"
    (folder / "frame.html").write_text(f"{told}{frames}", "utf-8")
    _, _, document = browse(folder / "frame.html", folder)
    [measured] = re.findall(r"<title>wide ([^<]*)</title>", document)
    widths = dict(one.split(":") for one in measured.split())
    return [int(widths[str(number)]) for number in range(len(pages))]

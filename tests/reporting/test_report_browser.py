"""The incident page in a real browser, where there is one."""

import json
import os
import shutil
import subprocess

import pytest

from auditor.reporting.incident.render import render_incident_report
from tests.making.report_stores import add_recording, make_rig, new_store

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
HOSTILE = "\"'><script>console.error('hostile')</script><img src=http://hostile.invalid/x onerror=console.error(1)>"
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

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium to open the page in")


def browse(page, folder):
    """What the browser's console said, the addresses it asked for, and the page as it understood it."""
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
    # The browser's own errands have no origin; what a page asks for has one.
    asked = [event["params"] for event in events if "initiator" in event.get("params", {})]
    addresses = [params["url"] for params in asked if params["initiator"] != "not an origin"]
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line], addresses, done.stdout


def test_a_page_of_hostile_text_opens_without_a_console_message_or_a_request(tmp_path):
    store = new_store(tmp_path)
    rig = make_rig(("velo", HOSTILE, "middle", "left"))
    add_recording(store, HOSTILE, rig=rig, attacks=[((1,), 5, 19)], pictured=[12], damage=(HOSTILE,), vehicle=HOSTILE)
    page = render_incident_report(store, out=tmp_path / "page.html")
    console, addresses, dom = browse(page, tmp_path)
    assert "What this audit cannot see" in dom
    assert console == []
    assert addresses == []
    assert "<script" not in dom


def test_the_browser_would_have_said_so(tmp_path):
    page = tmp_path / "bad.html"
    page.write_text("<script>console.error('said so')</script><img src='http://hostile.invalid/x'>", "utf-8")
    console, addresses, _ = browse(page, tmp_path)
    assert "said so" in console[0]
    assert addresses == ["http://hostile.invalid/x"]

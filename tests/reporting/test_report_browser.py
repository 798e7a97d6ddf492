"""The incident page in a real browser, where there is one."""

import pytest

from auditor.reporting.incident.render import render_incident_report
from tests.making.pages import BROWSER, browse
from tests.making.report_stores import add_recording, make_rig, new_store

HOSTILE = "\"'><script>console.error('hostile')</script><img src=http://hostile.invalid/x onerror=console.error(1)>"

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium to open the page in")


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

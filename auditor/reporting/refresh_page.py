"""The page of a refresh: one self-contained HTML page of what was decided for each rig kind, and why."""

from collections import Counter
from pathlib import Path

from auditor import __version__
from auditor.reporting.templates import fill
from auditor.store.store import Store
from auditor.store.versions.decisions import Decided, Refresh
from auditor.store.versions.next_steps import next_steps

_OF_ONE = {
    Decided.REFUSED: "Refused: the version in force stays.",
    Decided.HELD: "The new calibration is held for a person.",
    Decided.PROMOTED: "A new calibration is in force.",
    Decided.WAITING: "Too few clean recordings so far.",
    Decided.NOTHING_NEW: "Nothing new to learn.",
}
"""The page's headline where there is one rig kind; the worst first."""


def render_refresh_page(refresh: Refresh, store: Store, *, out: Path) -> Path:
    """Write the page of a refresh; answer `out`. Raises StoreError where it cannot be written.

    All of its text is escaped; it refers to nothing outside itself.
    """
    values = {
        "refresh": refresh,
        "auditor_version": __version__,
        "at": f"{refresh.at:%Y-%m-%d %H:%M} UTC",
        "headline": _headline(refresh),
        "store": str(store.folder),
        "next_steps": lambda decision: next_steps(decision, store.folder),
    }
    return store.write_page(out, fill("refresh.html", values))


def _headline(refresh: Refresh) -> str:
    if not refresh.decisions:
        return "Nothing was learnt: no recording could be looked at."
    if len(refresh.decisions) == 1:
        return _OF_ONE[refresh.decisions[0].decided]
    count = Counter(one.decided for one in refresh.decisions)
    told = [f"{count[decided]} {decided}" for decided in _OF_ONE if count[decided]]
    return f"Of {len(refresh.decisions)} rig kinds: {', '.join(told)}."

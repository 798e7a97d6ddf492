"""Alerts: findings that no incident holds, and that are told and counted as found all the same.

Evidence that adds up over time makes an incident (`incidents`). What lasts becomes the drive's own level, a short
recording has little time, and a hard road raises the limit: frames are named then, and no incident holds them. Two of
them in a row, a tenth of all frames, or one very strong frame are an alert. No rate of false alerts is promised.
"""

from collections.abc import Iterator

import numpy as np

from auditor.identification.evidence_parameters import ALERTS
from auditor.identification.incidents import Event
from auditor.model.arrays import Flags


def alerts(findings: Flags, accusing: Flags, audited: Flags, strong: Flags, held: Flags) -> list[Event]:
    """The alerts among F frames, in the order of time; all flags are (F,).

    `findings` are findings by themselves, `accusing` those that say attacked or unidentified, `audited` those with a
    verdict. The `strong` ones are told by themselves, and incidents hold those that are `held`.
    """
    loose = findings & ~held
    if 0 < ALERTS.share * np.count_nonzero(audited) <= np.count_nonzero(loose):
        return [Event(tuple(np.flatnonzero(loose).tolist()), alert=True)]
    groups = list(_rows(loose, accusing, audited))
    in_rows = {place for group in groups for place in group}
    groups += [(place,) for place in np.flatnonzero(loose & strong).tolist() if place not in in_rows]
    return [Event(group, alert=True) for group in sorted(groups)]


def _rows(loose: Flags, accusing: Flags, audited: Flags) -> Iterator[tuple[int, ...]]:
    """Findings in a row, of which one at least accuses; frames that could not be audited do not end a row."""
    places = np.flatnonzero(audited | loose)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], loose[places], [False]]).astype(np.int8)))
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        row = places[first:end]
        if len(row) >= ALERTS.fewest_in_a_row and accusing[row].any():
            yield tuple(row.tolist())

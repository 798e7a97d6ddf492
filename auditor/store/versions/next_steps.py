"""What a person does after a refresh: the command of each step, to be copied."""

from collections.abc import Iterator
from pathlib import Path
from shlex import join
from typing import NamedTuple

from auditor.model.text import one_line
from auditor.store.versions.decisions import Decided, Decision


class NextStep(NamedTuple):
    """What to do, and the command for it."""

    what: str
    command: str


def next_steps(one: Decision, store: Path) -> list[NextStep]:
    """What a person does about a rig kind, in order; nothing where nothing waits for a person."""
    return [NextStep(what, one_line(join([*words, "--store", str(store)]))) for what, words in _steps(one)]


def _steps(one: Decision) -> Iterator[tuple[str, list[str]]]:
    candidate, before = one.calibration_id or "", one.before
    if one.look_at:
        what = f"look at the recordings that wait ({len(one.look_at)}) and at their incidents"
        yield what, ["auditor", "calibration", "quarantine"]
        first = one.look_at[0].name
        yield "of each that is clean say so: the next refresh learns from it", ["auditor", "label", first, "--clean"]
        attack = ["--sensor", "S_NUMBER", "--attack", "KIND"]
        yield "of each that was attacked say what: it is never learnt from", ["auditor", "label", first, *attack]
    if one.decided is Decided.WAITING:
        yield "name recordings that you know to be clean", ["auditor", "refresh", "RECORDING", "--clean"]
    if one.decided is Decided.HELD:
        if before is not None:
            yield "look at what the candidate changes", ["auditor", "calibration", "diff", before[:12], candidate[:12]]
        what = "put it in force if that is right, else leave it: the next refresh makes another"
        yield what, ["auditor", "calibration", "promote", candidate[:12]]
    if one.decided is Decided.PROMOTED and one.provisional:
        what = "confirm the version in force: nobody named its recordings clean, or they are too few"
        yield what, ["auditor", "calibration", "promote", candidate[:12]]

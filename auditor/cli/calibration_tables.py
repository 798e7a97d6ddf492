"""What a calibration prints: its thresholds, and how they would have judged recordings that they have not seen."""

from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from auditor.cli.output import answer, check_in_words, emit, print_rows, say
from auditor.model.text import first_few

if TYPE_CHECKING:
    from auditor.identification.cross_validation import LeftOut
    from auditor.identification.systems import System
    from auditor.model.calibration import Calibration, NullDistribution, RobustThresholds
    from auditor.pipeline.calibrations.making import MadeCalibration
    from auditor.pipeline.calibrations.versions import CalibrationEntry
    from auditor.store.store import Store

_MOST_ROWS = 20
_MOST_NAMED = 5
_MINUTES, _SECONDS = 60, 3600
"""Of an hour."""
_MANY = 0.2
"""The share of findings from which on a recording may not be clean, though none of them make an incident."""

_ROBUST_COLUMNS = ("check", "sensor", "others", "N", "expected", "theta", "thresholds")
_PAPER_COLUMNS = ("statistic", "triple", "N", "median", "max", "r", "theta", "resolvable")
_LEFT_OUT_COLUMNS = ("recording", "frames", "time", "findings", "incidents", "findings by paper")
_COUNTED = ("frames", "hours", "findings", "incidents", "findings by paper")


def show_robust(made: "MadeCalibration", form: str) -> None:
    """The thresholds of the robust method at r, one row a sensor check.

    A table has the checks that count where no sensor is missing or named; other forms have all.
    """
    from auditor.store.export import table_of  # noqa: PLC0415 - Arrow is heavy

    thresholds, system = made.thresholds, made.asked.system
    rows = _sensor_checks(thresholds, system)
    if form != "table":
        emit(table_of(rows), form)
        return
    _head(made.calibration)
    answer(
        f"thresholds {learnt(thresholds.drives)}: at r = {made.asked.r} a finding has a z above {thresholds.limit:.2f}"
    )
    counting = [rows[place] for place in system.counting(frozenset()).tolist()]
    print_rows([check_in_words(row) for row in counting], _ROBUST_COLUMNS)
    answer(f"the other {len(rows) - len(counting)} are for frames in which a sensor is missing or named: --format csv")


def learnt(drives: int) -> str:
    """What thresholds rest on, in words."""
    return f"learnt from {drives} drive{'' if drives == 1 else 's'}" if drives else "prior"


def show_paper(calibration: "Calibration", store: "Store", r: Decimal, form: str) -> None:
    """The thresholds of the paper's method at r, one row a statistic and triple."""
    from auditor.store.export import rows_of  # noqa: PLC0415 - DuckDB is heavy
    from auditor.store.queries import run_query  # noqa: PLC0415 - DuckDB is heavy

    thresholds = run_query(store, "thresholds", {"calibration": calibration.calibration_id, "r": r})
    if form != "table":
        emit(thresholds, form)
        return
    _head(calibration)
    rows = rows_of(thresholds)
    shown = [{**row, "triple": f"{row['i']},{row['j']},{row['k']}", "max": row["largest"]} for row in rows]
    print_rows(shown, _PAPER_COLUMNS)


def show_left_out(kept: "CalibrationEntry", r: Decimal, form: str) -> None:
    """How many frames of each clean recording are not clean by thresholds of the others."""
    robust, paper = kept.left_out, kept.left_out_by_paper
    names = {one.recording_id: one.name for one in kept.version.included}
    if not paper:
        say(f"one clean recording: no other can judge it; by the prior alone {_share(robust)} at r = {r}")
        _warn_of_findings(robust, names, "the prior")
        return
    if form == "table":
        _table(robust, paper, names)
    hours, recordings = sum(one.hours for one in robust), len({one.recording for one in robust})
    say(
        f"leave-one-recording-out, each of {recordings} recordings judged by the others at r = {r}: "
        f"{_share(robust)} and {_incidents(robust, hours)} by the robust method, {_share(paper)} by the paper's"
    )
    _warn_of_findings(robust, names, "the others")


def _head(calibration: "Calibration") -> None:
    answer(f"Calibration {calibration.calibration_id} from {len(calibration.recordings)} clean recordings")
    answer(f"holds for {calibration.rig_kind}, matcher {calibration.procedure.matcher}")


def _sensor_checks(thresholds: "RobustThresholds", system: "System") -> "list[dict[str, Any]]":
    return [
        {
            "calibration_id": thresholds.calibration_id,
            "check": one.check.value,
            "sensor": one.sensor,
            "others": list(one.others),
            "drives": expected.drives,
            "N": expected.samples,
            "mean": expected.mean,
            "deviation": expected.deviation,
            "expected": _statistic(expected, 0),
            "r": thresholds.r,
            "limit": thresholds.limit,
            "theta": _statistic(expected, thresholds.limit),
            "thresholds": learnt(expected.drives),
        }
        for one, expected in ((one, thresholds.expected[one]) for one in system.sensor_checks)
    ]


def _statistic(expected: "NullDistribution", z: float) -> float:
    """The statistic that has this z: at 0 what is expected, at the limit the threshold."""
    from auditor.identification.prior import statistic_at  # noqa: PLC0415 - NumPy is heavy

    return statistic_at(expected.mean + z * expected.deviation)


def _table(robust: "Sequence[LeftOut]", paper: "Sequence[LeftOut]", names: Mapping[str, str]) -> None:
    """The recordings with the most findings, and all together. A finding is a frame that is not clean."""
    rows: list[dict[str, Any]] = [
        {
            "recording": names.get(one.recording, one.recording),
            "frames": one.frames,
            "hours": one.hours,
            "findings": one.findings,
            "incidents": one.incidents,
            "findings by paper": other.findings,
        }
        for one, other in zip(robust, paper, strict=True)
    ]
    worst = sorted(rows, key=lambda row: (-row["findings"], -row["findings by paper"]))[:_MOST_ROWS]
    whole = {column: sum(row[column] for row in rows) for column in _COUNTED}
    title = "Leave-one-recording-out: each recording judged by the others"
    if len(rows) > len(worst):
        title += f"; the {len(worst)} with the most findings of {len(rows)}"
    shown = [{**row, "time": _time(row["hours"])} for row in (*worst, {"recording": "all together", **whole})]
    print_rows(shown, _LEFT_OUT_COLUMNS, title=title)


def _warn_of_findings(results: "Sequence[LeftOut]", names: Mapping[str, str], judge: str) -> None:
    """A recording in which others, or the prior, find incidents or much else may not be clean, or not like them."""
    suspects = [
        f"{names.get(one.recording, one.recording)} ({_found(one)})"
        for one in sorted(results, key=lambda one: (-one.incidents, -one.findings))
        if one.incidents or one.findings >= _MANY * one.frames
    ]
    if suspects:
        say(
            f"WARNING: judged by {judge} there are findings in {first_few(suspects, _MOST_NAMED)}: check "
            "them before you use these thresholds, and leave out what is not clean: it hides attacks like its own"
        )


def _found(recording: "LeftOut") -> str:
    """Its incidents; where it has none, its frames that are findings."""
    return _number(recording.incidents) if recording.incidents else f"{recording.findings} of {recording.frames} frames"


def _share(results: "Sequence[LeftOut]") -> str:
    from auditor.identification.cross_validation import wilson  # noqa: PLC0415 - NumPy is heavy

    findings, frames = sum(one.findings for one in results), sum(one.frames for one in results)
    low, high = wilson(findings, frames)
    share = findings / max(frames, 1)
    return f"{findings} of {frames} frames are findings ({share:.2%}, 95 % interval {low:.2%} to {high:.2%})"


def _incidents(results: "Sequence[LeftOut]", hours: float) -> str:
    return f"{_number(sum(one.incidents for one in results))} in {_time(hours)}"


def _time(hours: float) -> str:
    """A length of time in the largest unit that it has one of."""
    for unit, each in (("h", 1), ("min", _MINUTES)):
        if hours * each >= 1:
            return f"{hours * each:.3g} {unit}"
    return f"{hours * _SECONDS:.3g} s"


def _number(incidents: int) -> str:
    return f"{incidents} incident{'' if incidents == 1 else 's'}"

"""What a calibration prints: its thresholds, and how they would have judged recordings that they have not seen."""

from collections.abc import Mapping, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from auditor.cli.output import answer, emit, print_rows, say

if TYPE_CHECKING:
    from auditor.identification.cross_validation import LeftOut
    from auditor.identification.naming import System
    from auditor.model.calibration import Calibration
    from auditor.store import Store

_MOST_ROWS = 20
_MOST_NAMED = 5
_ROBUST_COLUMNS = ("check", "sensors", "N", "median", "max", "r", "theta", "scale", "resolvable")
_PAPER_COLUMNS = ("statistic", "triple", "N", "median", "max", "r", "theta", "resolvable")
_LEFT_OUT_COLUMNS = ("recording", "frames", "hours", "findings", "incidents", "findings by paper")


def show_robust(calibration: "Calibration", system: "System", r: Decimal, form: str) -> None:
    """The thresholds of the robust method at r, one row a pair check."""
    from auditor.store import table_of  # noqa: PLC0415 - Arrow is heavy

    rows = list(_pair_checks(calibration, system, r))
    if form != "table":
        emit(table_of(rows), form)
        return
    _head(calibration)
    shown = [{**row, "sensors": f"S_{row['i']} S_{row['k']}", "max": row["largest"]} for row in rows]
    print_rows(shown, _ROBUST_COLUMNS)


def show_paper(calibration: "Calibration", store: "Store", r: Decimal, form: str) -> None:
    """The thresholds of the paper's method at r, one row a statistic and triple."""
    from auditor.store import rows_of, run_query  # noqa: PLC0415 - DuckDB is heavy

    thresholds = run_query(store, "thresholds", {"calibration": calibration.calibration_id, "r": r})
    if form != "table":
        emit(thresholds, form)
        return
    _head(calibration)
    rows = rows_of(thresholds)
    shown = [{**row, "triple": f"{row['i']},{row['j']},{row['k']}", "max": row["largest"]} for row in rows]
    print_rows(shown, _PAPER_COLUMNS)


def show_left_out(
    calibration: "Calibration", system: "System", r: Decimal, form: str, names: Mapping[str, str]
) -> None:
    """How many frames of each clean recording are findings by thresholds of the others; `names` are by id."""
    from auditor.identification.cross_validation import leave_one_out_paper, leave_one_out_robust  # noqa: PLC0415 - NumPy is heavy
    from auditor.model.measurement import Statistic  # noqa: PLC0415

    frames = sum(one.frames for one in calibration.clean)
    if len(calibration.recordings) < 2:
        say(
            f"one clean recording of {frames} frames: no other can judge it, so how often others would be findings is "
            "unknown"
        )
        return
    robust = leave_one_out_robust(calibration, system, r)
    paper = leave_one_out_paper(calibration, Statistic.GATED, r)
    if form == "table":
        _table(robust, paper, names)
    hours = sum(one.hours for one in robust)
    say(
        f"leave-one-recording-out, each of {len(calibration.recordings)} recordings judged by the others at r = {r}: "
        f"{_share(robust)} and {_incidents(robust, hours)} by the robust method, {_share(paper)} by the paper's"
    )
    _warn_of_incidents(robust, names)
    say(f"{frames} clean frames resolve r = 0 and r from {1 / frames:.2g} up")


def _head(calibration: "Calibration") -> None:
    answer(f"Calibration {calibration.calibration_id} from {len(calibration.recordings)} clean recordings")
    answer(f"holds for {calibration.rig_kind}, matcher {calibration.procedure.matcher}")


def _pair_checks(calibration: "Calibration", system: "System", r: Decimal) -> "list[dict[str, Any]]":
    import numpy as np  # noqa: PLC0415 - keeps --help quick

    from auditor.identification.scores import scales_of  # noqa: PLC0415
    from auditor.identification.thresholds import resolvable  # noqa: PLC0415

    ratios = calibration.ratios_of(system.pair_checks)
    return [
        {
            "calibration_id": calibration.calibration_id,
            "check": pair_check.check.value,
            "i": pair_check.i,
            "k": pair_check.k,
            "N": scale.samples,
            "median": float(np.nanmedian(column)),
            "largest": float(np.nanmax(column)),
            "r": r,
            "theta": scale.theta,
            "scale": scale.scale,
            "resolvable": resolvable(r, scale.samples),
        }
        for pair_check, column, scale in zip(
            system.pair_checks, ratios.T, scales_of(ratios, system.pair_checks, r), strict=True
        )
        if scale is not None
    ]


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
    whole = {column: sum(row[column] for row in rows) for column in _LEFT_OUT_COLUMNS[1:]}
    title = "Leave-one-recording-out: each recording judged by the others"
    if len(rows) > len(worst):
        title += f"; the {len(worst)} with the most findings of {len(rows)}"
    print_rows([*worst, {"recording": "all together", **whole}], _LEFT_OUT_COLUMNS, title=title)


def _warn_of_incidents(results: "Sequence[LeftOut]", names: Mapping[str, str]) -> None:
    """A recording in which the others find incidents may not be clean, or not like them."""
    suspects = [
        f"{names.get(one.recording, one.recording)} ({one.incidents})"
        for one in sorted(results, key=lambda one: -one.incidents)
        if one.incidents
    ]
    if suspects:
        more = f" and {len(suspects) - _MOST_NAMED} more" if len(suspects) > _MOST_NAMED else ""
        say(
            f"WARNING: judged by the others there are incidents in {', '.join(suspects[:_MOST_NAMED])}{more}: check "
            "them before you use these thresholds, and leave out what is not clean: it hides attacks like its own"
        )


def _share(results: "Sequence[LeftOut]") -> str:
    from auditor.identification.cross_validation import wilson  # noqa: PLC0415 - NumPy is heavy

    findings, frames = sum(one.findings for one in results), sum(one.frames for one in results)
    low, high = wilson(findings, frames)
    share = findings / max(frames, 1)
    return f"{findings} of {frames} frames are findings ({share:.2%}, 95 % interval {low:.2%} to {high:.2%})"


def _incidents(results: "Sequence[LeftOut]", hours: float) -> str:
    count = sum(one.incidents for one in results)
    return f"{count} incident{'' if count == 1 else 's'} in {hours:.2g} h"

"""What the evaluation page shows: the template reads these and nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass

from auditor.reporting.evaluation.plots import Panel

LEFT_OUT = {
    "nothing": "in sample, as in the paper",
    "block": "left out by blocks of ten frames",
    "recording": "left out by recording",
    "family": "left out by family",
}
"""What the page calls the ways of taking theta, in its order."""

STRENGTHS = ("mild", "strong", "opaque")


@dataclass(frozen=True)
class Rate:
    """k of n, with Wilson's 95 % interval; `resolvable` is False where theta was the maximum though r > 0."""

    k: int
    n: int
    low: float
    high: float
    resolvable: bool = True

    @property
    def share(self) -> float:
        """K / n."""
        return self.k / self.n


Cell = Rate | str | None


@dataclass(frozen=True)
class PageRow:
    """One row of a table."""

    label: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Grid:
    """A table: `groups` head several columns each, `columns` one; a column named `paper` holds published figures."""

    title: str
    groups: tuple[tuple[str, int], ...]
    columns: tuple[str, ...]
    rows: tuple[PageRow, ...]

    @property
    def unresolved(self) -> bool:
        """True where some r is below 1/N."""
        return any(isinstance(cell, Rate) and not cell.resolvable for row in self.rows for cell in row.cells)


@dataclass(frozen=True)
class Sheet:
    """Small panels that belong together, with what they are to be compared with.

    `left_out` says that their dashed lines are of thresholds with frames left out.
    """

    title: str
    note: str
    panels: tuple[Panel, ...]
    legend: tuple[tuple[str, str], ...]
    left_out: bool = True


@dataclass(frozen=True)
class EvaluatedRecording:
    """One recording of a setup."""

    name: str
    recording_id: str
    frames: int
    skipped: int


@dataclass(frozen=True)
class Setup:
    """Everything that may be pooled: one rig kind, one way of measuring, real or synthetic drives."""

    kind: str
    synthetic: bool
    matcher: str
    settings: str
    counting_version: int
    recordings: tuple[EvaluatedRecording, ...]
    sensors: tuple[tuple[int, str], ...]
    cases: int
    seconds: float
    clean_seconds: float
    draws: int
    attack_every: int
    seeds: tuple[int, ...]
    lidar: bool
    max_attacked: int
    grids: Mapping[str, tuple[Grid, ...]]
    sheets: Mapping[str, tuple[Sheet, ...]]
    unseen: tuple[str, ...]

    @property
    def frames(self) -> int:
        """Clean frames."""
        return sum(recording.frames for recording in self.recordings)

    @property
    def cost(self) -> float | None:
        """Seconds for one case over seconds for measuring one clean frame; None where nothing was attacked."""
        attacked = self.cases - self.frames
        if attacked <= 0 or not self.clean_seconds:
            return None
        return (self.seconds - self.clean_seconds) / attacked / (self.clean_seconds / self.frames)


@dataclass(frozen=True)
class MissedAttack:
    """An attack that was missed: what it was, where, and the attacked data as an image; `reason` where there is none.

    `largest_z` and `limit_z` are None where an earlier version judged it.
    """

    attack: str
    sensor: str
    kind: str
    recording: str
    frame: int
    largest_z: float | None
    limit_z: float | None
    image: str | None
    reason: str


@dataclass(frozen=True)
class EvaluationPage:
    """The whole page. `judged` is False where no case has a verdict by the robust method."""

    made_at: str
    auditor_version: str
    store: str
    setups: tuple[Setup, ...]
    missed: tuple[MissedAttack, ...]
    judged: bool

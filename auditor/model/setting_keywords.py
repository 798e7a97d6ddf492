"""The settings as keywords of `import auditor`, for type checkers: the fields of `Criteria` and `MeasureSettings`."""

from collections.abc import Iterable
from decimal import Decimal
from pathlib import Path
from typing import TypedDict

from auditor.model.pictures import Pictures
from auditor.model.settings import Engine
from auditor.model.verdict import Method, Statistic


class JudgingKeywords(TypedDict, total=False):
    """The fields of `Criteria` as keywords, for type checkers."""

    r: Decimal | float | str
    method: Method | str
    statistic: Statistic | str
    incidents_per_hour: float | None
    transfer: bool
    strict: bool
    recount: bool
    calibration: str | None
    min_coverage: float
    min_view: float
    no_sensors: Iterable[str]


class MeasuringKeywords(TypedDict, total=False):
    """The fields of `MeasureSettings` as keywords, for type checkers."""

    matcher: str
    weights: str | Path | None
    align_corners: bool | None
    max_disparity: int | None
    device: str
    precision: str
    compiled: bool
    rig: str | Path | None
    vehicle: str | None
    weather: str | None
    drive: str | None
    path_pattern: str | None
    time_limit: float | None
    memory_limit: float
    jobs: int | None
    pictures: Pictures | str
    shard: str | None
    engine: Engine | str
    address: str | None
    spool: str | Path | None
    spool_limit: float | None
    measure_again: bool
    verify_content: bool


class ScanKeywords(JudgingKeywords, MeasuringKeywords, total=False):
    """The settings of a scan as keywords, for type checkers."""

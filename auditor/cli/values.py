"""Types of the values that options take."""

import re
from decimal import Decimal
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A number within limits; "nan" and "inf", which Python reads as numbers, are refused."""

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number. Fails as click does."""
        number = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a number: write one such as 0.5", param, ctx)
        return float(number)


class LocalPath(click.Path):
    """A path on this computer; an address such as s3://bucket is refused, which would make a folder of that name."""

    def __init__(self, *, exists: bool = False, dir_okay: bool = True) -> None:
        super().__init__(exists=exists, dir_okay=dir_okay, path_type=Path)

    def convert(
        self, value: str | PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | PathLike[str]:
        """The path. Fails as click does."""
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.resources import local_path  # noqa: PLC0415

        try:
            local_path(str(value))
        except SettingError as error:
            self.fail(f"{value}: {error.what}; {error.remedy}", param, ctx)
        return super().convert(value, param, ctx)


PATH = LocalPath()
"""A file or folder of this computer, as a Path."""


class RecordingPlace(LocalPath):
    """A path on this computer, or the address of objects, such as s3://bucket/fleet/**/*.mcap."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 - click's signature
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - a Path or an Address
        """The path or address. Fails as click does."""
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.pipeline.remote.addresses import Address, address_of  # noqa: PLC0415

        if isinstance(value, Address):
            return value
        try:
            return address_of(value) or super().convert(value, param, ctx)
        except SettingError as error:
            self.fail(f"{error.where}: {error.what}; {error.remedy}", param, ctx)


PLACE = RecordingPlace()
"""Where recordings lie, as a Path or an Address."""


class _Rate(click.ParamType[Decimal]):
    name = "rate"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Decimal:
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.identification.thresholds import parse_r  # noqa: PLC0415

        try:
            return value if isinstance(value, Decimal) else parse_r(str(value))
        except SettingError as error:
            self.fail(f"{error.what}; {error.remedy}", param, ctx)


RATE = _Rate()
"""A designated false-alarm rate r, as a Decimal in [0, 1]."""


class _Sensor(click.ParamType[int]):
    name = "S_k"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        found = re.fullmatch(r"(?:S_?)?(\d+)", str(value), re.IGNORECASE)
        if not found:
            self.fail(f"{value!r} is not a sensor: write S_0 for the LiDAR, S_1 for the rightmost camera", param, ctx)
        return int(found[1])


SENSOR = _Sensor()
"""A sensor by its number, as S_2 or 2."""

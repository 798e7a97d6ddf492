"""The options of a matcher on the command line, beside its name."""

from dataclasses import dataclass, fields
from pathlib import Path

from auditor.errors import SettingError


@dataclass(frozen=True)
class MatcherOptions:
    """Options of matchers that are networks; what is None or left at its default was not given.

    `weights` file of psmnet, which otherwise has those that come with auditor; its `align_corners` convention and
    `max_disparity` in pixels; `device` cpu, cuda or cuda:1; `precision` fp32, tf32, fp16 or bf16; whether it is
    `compiled` for the device; `threads` of the CPU that one process may use.
    """

    weights: Path | None = None
    align_corners: bool | None = None
    max_disparity: int | None = None
    device: str = "cpu"
    precision: str = "fp32"
    compiled: bool = False
    threads: int = 1

    def only(self, matcher: str, *taken: str) -> None:
        """Raises SettingError where an option was given that the matcher does not take."""
        for option in fields(self):
            if option.name not in (*taken, "threads") and getattr(self, option.name) != option.default:
                raise SettingError(f"{matcher} takes no such option", where=_spelt(option.name), remedy="leave it out")


def _spelt(field: str) -> str:
    """What the command line calls it."""
    return "--compile" if field == "compiled" else "--" + field.replace("_", "-")

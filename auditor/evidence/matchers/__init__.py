"""Stereo matchers: two rectified images become a disparity map."""

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

from auditor.errors import SettingError
from auditor.evidence.matchers.interface import Matcher
from auditor.evidence.matchers.sgbm import SgbmMatcher

BUILT_IN: Mapping[str, Callable[[], Matcher]] = {
    "sgbm": SgbmMatcher,
    "sgbm-full": lambda: SgbmMatcher(step=1),
}


def find_matcher(name: str) -> Matcher:
    """The matcher of that name: a built-in one, else one of the entry points `auditor.matchers`.

    Raises SettingError that lists the known names.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    plugins = {point.name: point for point in entry_points(group="auditor.matchers")}
    if name in plugins:
        factory: Callable[[], Matcher] = plugins[name].load()
        return factory()
    known = ", ".join([*BUILT_IN, *plugins])
    raise SettingError(f"no matcher is called {name!r}", where="--matcher", remedy=f"use one of: {known}")


__all__ = ["BUILT_IN", "Matcher", "SgbmMatcher", "find_matcher"]

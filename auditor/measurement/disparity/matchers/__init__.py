"""Stereo matchers: two rectified images become a disparity map."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from auditor.errors import SettingError, needing
from auditor.measurement.disparity.matchers.interface import Matcher, MatcherOptions, libraries
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.resources import entries_of

NO_NETWORK = MatcherOptions()
"""The options of matchers that are not networks."""


def find_matcher(name: str, options: MatcherOptions = NO_NETWORK) -> Matcher:
    """The matcher of that name: a built-in one, a model's file, else one of the entry points `auditor.matchers`.

    Raises SettingError that lists the known names, for an option that the matcher does not take, for a package that
    it needs and that is not installed, and as the matchers themselves do.
    """
    if name in BUILT_IN:
        return BUILT_IN[name](options)
    kind, _, file = name.partition(":")
    if kind in MODEL_FILES and file:
        return MODEL_FILES[kind](Path(file), options)
    plugins = {point.name: point for point in entries_of("auditor.matchers")}
    if name in plugins:
        options.only(name)
        factory: Callable[[], Matcher] = plugins[name].load()
        return factory()
    names = ", ".join([*BUILT_IN, *(f"{kind}:FILE" for kind in MODEL_FILES), *plugins])
    raise SettingError(f"no matcher is called {name!r}", where="--matcher", remedy=f"use one of: {names}")


def _sgbm(options: MatcherOptions) -> Matcher:
    options.only("sgbm")
    return SgbmMatcher()


def _sgbm_full(options: MatcherOptions) -> Matcher:
    options.only("sgbm-full")
    return SgbmMatcher(step=1)


def _psmnet(options: MatcherOptions) -> Matcher:
    with needing("psmnet needs", "psmnet", "--matcher"):
        from auditor.measurement.disparity.matchers.psmnet import open_psmnet  # noqa: PLC0415 - torch takes seconds to import
    return open_psmnet(options)


def _onnx(path: Path, options: MatcherOptions) -> Matcher:
    options.only("onnx", "device")
    with needing("onnx needs", "onnx", "--matcher"):
        from auditor.measurement.disparity.matchers.own_networks import open_onnx  # noqa: PLC0415 - an extra
    return open_onnx(path, device=options.device, threads=options.threads)


def preflight(matcher: Matcher, rig: Rig, first: Sequence[Frame], count: int) -> tuple[str, ...]:
    """What a network reports before it measures `count` frames, from the first of them: its cost, and warnings.

    Matchers other than PSMNet report nothing.
    """
    if matcher.name != "psmnet":
        return ()
    return tuple(psmnet_module("preflight").preflight(matcher, rig, first, count))


def psmnet_module(name: str, package: str = "auditor.measurement.disparity.matchers.psmnet") -> ModuleType:
    """A module that needs PSMNet's packages, such as `weights`. Raises SettingError where they are missing."""
    with needing("psmnet needs", "psmnet", "--matcher"):
        return import_module(f"{package}.{name}")


BUILT_IN: Mapping[str, Callable[[MatcherOptions], Matcher]] = {
    "sgbm": _sgbm,
    "sgbm-full": _sgbm_full,
    "psmnet": _psmnet,
}
MODEL_FILES: Mapping[str, Callable[[Path, MatcherOptions], Matcher]] = {"onnx": _onnx}
"""Matchers that are files of the user's: `onnx:model.onnx`."""

__all__ = [
    "BUILT_IN",
    "MODEL_FILES",
    "NO_NETWORK",
    "Matcher",
    "MatcherOptions",
    "SgbmMatcher",
    "find_matcher",
    "libraries",
    "preflight",
    "psmnet_module",
]

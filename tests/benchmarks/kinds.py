"""What the benchmarks of kinds of attack share: their options, the sources they measure, and the scenes they keep."""

import argparse
import os
from collections.abc import Callable, Sequence
from decimal import Decimal
from functools import partial
from pathlib import Path

import numpy as np

from auditor.measurement import use_one_thread
from auditor.model.frames import Frame
from tests.benchmarks.clean_statistics import Source, sources_of
from tests.benchmarks.scenes import Scene, keep, load

Measure = Callable[[Source, str, str, int], Scene]
"""The scene of a source with its name and family, and the number of its frames that are attacked."""


def options_of(text: str | None, *, frames: int, attacked: int) -> argparse.ArgumentParser:
    """The options that all of them have; `frames` of each street and those `attacked` of each drive unless told."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0] if text else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--streets", type=int, default=0, help="this many streets in place of the real drives")
    parser.add_argument("--first", type=int, default=6000)
    parser.add_argument("--frames", type=int, default=frames, help="of each street")
    parser.add_argument("--scale", type=float, default=1.0, help="of the pictures")
    parser.add_argument("--attacked", type=int, default=attacked, help="frames of each drive that are attacked")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    return parser


def scenes_of(options: argparse.Namespace, measured: Measure) -> list[Scene]:
    """The scenes of the real drives, or of streets; what is in the folder is not measured again."""
    use_one_thread()
    data = None if options.streets else Path(os.environ["AUDITOR_TEST_DATA"])
    streets = range(options.first, options.first + options.streets)
    for name, family, source in sources_of(data, streets, options.frames, scale=options.scale):
        keep(options.into, name, partial(measured, source, name, family, options.attacked))
    return load(options.into)


def spread(frames: Sequence[Frame], count: int) -> set[int]:
    """The numbers of so many frames, evenly spread."""
    return {frames[place].number for place in np.linspace(0, len(frames) - 1, count).astype(int)}


def kinds_of(frame: Frame) -> str:
    """Of each camera in order whether it is grey (g) or has colours (c)."""
    return "".join("c" if frame.images[n].pixels.ndim > 2 else "g" for n in sorted(frame.images))

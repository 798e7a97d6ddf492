"""Light on a whole lens, and cameras that go blind, by the command line: `python -m tests.benchmarks.veils`.

Of the real drives (`AUDITOR_TEST_DATA`) the LiDAR and three cameras, and four, are changed in one camera, S_2,
in the last half of the frames or in all: a veil lifts all of its levels, it shows noise alone, or it is merely brighter
or darker. Each is scanned into a store of its own, nothing learnt. Printed are of so many recordings those that are
found (exit code 1 or 4), those with an incident, and those whose findings name the camera, or another sensor.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.real_drives import frames as frames_of
from tests.benchmarks.two_cameras import DRIVES, scanned

CAMERA = 2

Pixels = NDArray[np.uint8]
Change = Callable[[Pixels, int], Pixels]


def linear(gain: float, offset: float) -> Change:
    """Levels times a gain, and an offset more."""
    return lambda pixels, number: (pixels * np.float32(gain) + np.float32(offset)).clip(0, 255).astype(np.uint8)


def noise(level: float, deviation: float) -> Change:
    """Noise about a level, and no picture."""

    def blinded(pixels: Pixels, number: int) -> Pixels:
        drawn = np.random.default_rng(number).normal(level, deviation, pixels.shape)
        return np.asarray(drawn.clip(0, 255), dtype=np.uint8)

    return blinded


CHANGES: dict[str, Change] = {
    "0.6 of the contrast and 90 levels": linear(0.6, 90),
    "0.8 and 50": linear(0.8, 50),
    "60 levels": linear(1, 60),
    "0.3 and 150": linear(0.3, 150),
    "noise about 3": noise(3, 2),
    "noise about 128": noise(128, 4),
    "noise about 252": noise(252, 2),
    "0.6 times as bright": linear(0.6, 0),
    "1.3 times as bright": linear(1.3, 0),
    "1.7 times as bright": linear(1.7, 0),
}


def changed(frame: Frame, change: Change) -> Frame:
    """A frame whose camera shows something else."""
    image = frame.images[CAMERA]
    pixels = np.ascontiguousarray(change(image.pixels, frame.number))
    return replace(frame, images={**frame.images, CAMERA: replace(image, pixels=pixels)})


def said_of(rig: Rig, frames: Sequence[Frame], folder: Path) -> Counter[str]:
    """What a scan says of a recording in which the camera was changed."""
    found, findings = scanned(rig, frames, folder)
    return Counter(
        {
            "recordings": 1,
            "found": found,
            "with an incident": any(one["grade"] == "incident" for one in findings),
            "named": any(one["attacked"] == [CAMERA] for one in findings),
            "another named": any(one["attacked"] not in ([], [CAMERA]) for one in findings),
        }
    )


def main() -> None:
    found: dict[tuple[str, str], Counter[str]] = {}
    with TemporaryDirectory() as folder:
        for number in DRIVES:
            for all_cameras in (False, True):
                rig, stream = frames_of(number, all_cameras=all_cameras, colour=True)
                clean = list(stream)
                for what, change in CHANGES.items():
                    for lasts, first in (("the last half", len(clean) // 2), ("all", 0)):
                        frames = [*clean[:first], *(changed(one, change) for one in clean[first:])]
                        found.setdefault((what, lasts), Counter()).update(said_of(rig, frames, Path(folder)))
    for (what, lasts), tally in found.items():
        print(f"{what}, {lasts}: {', '.join(f'{name} {count}' for name, count in tally.items())}", flush=True)


if __name__ == "__main__":
    main()

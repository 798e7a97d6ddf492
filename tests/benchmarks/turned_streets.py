"""Frames of streets with one camera turned little by little, measured and kept as scenes.

`python -m tests.benchmarks.turned_streets --into FOLDER [--streets 9000 9019 9040 9061]`: one frame of each street,
clean and with the camera turned about each axis. A case is called "pitch 0.12", by axis and degrees. See
tests.benchmarks.fleet_nights.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

from auditor.lab.evaluation.sources import Street
from auditor.measurement import FaultFeatures, measure, use_one_thread
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.clean_statistics import MATCHER, case_of
from tests.benchmarks.scenes import Case, Scene, keep
from tests.benchmarks.turned_frames import STEP_DEG, TURNED, turned_frame

STEPS = (1, 2, 4, 6, 7, 8, 10, 16)
TURNING = ("pitch", "yaw")
PLACE = 3


def cases(frame: Frame, rig: Rig) -> Iterator[Case]:
    """The frame with the camera at its place, and turned by each step about each axis."""
    yield _case(turned_frame(frame, rig, TURNING[0], 0), rig)
    for axis in TURNING:
        for step in STEPS:
            yield _case(turned_frame(frame, rig, axis, step), rig, f"{axis} {step * STEP_DEG:.2f}")


def _case(frame: Frame, rig: Rig, name: str = "") -> Case:
    found, arrays = measure(frame, rig, MATCHER)
    return case_of(replace(found, fault_features=FaultFeatures().update(arrays)), rig, name, (TURNED,) if name else ())


def turned(street: Street) -> Scene:
    """The cases of a frame of a street."""
    with street.open() as (drive,):
        frame = next(one for one in islice(drive.frames, PLACE, None) if isinstance(one, Frame))
        return Scene(str(street), street.family, drive.rig, "", tuple(cases(frame, drive.rig)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--streets", type=int, nargs="+", default=[9000, 9019, 9040, 9061])
    options = parser.parse_args()
    use_one_thread()
    for street in (Street(seed, 100, 4) for seed in options.streets):
        if keep(options.into, str(street), partial(turned, street)):
            print(street, flush=True)


if __name__ == "__main__":
    main()

"""How well clean, attacked and wrong recordings fit their rig: what decides where verdicts are withheld.

AUDITOR_TEST_DATA=... python -m tests.benchmarks.geometry_fit
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import islice

import numpy as np

from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.measurement import CalibrationMonitor, FaultFeatures, geometry_fit, measure, use_one_thread
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.arrays import Points
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.real_drives import frames
from tests.making.wrong_rigs import CASES as WRONG_RIGS
from tests.making.wrong_rigs import Case

_RNG = np.random.default_rng(1)


def facula(camera: int, radius_px: float) -> Case:
    """Opaque light in the middle of a camera's image."""
    light = Facula(2000, radius_px, 620, 187)
    return lambda rig, frame: (
        rig,
        replace(frame, images={**frame.images, camera: light.apply(frame.images[camera])}),
    )


def wall(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
    """The paper's wall, 2.5 m wide and 6 m away."""
    assert frame.cloud is not None
    return rig, replace(frame, cloud=BogusWall(6.0, 0.0).apply(frame.cloud, rig))


def points(change: Callable[[Points], Points]) -> Case:
    """The LiDAR writes other coordinates than it should."""

    def changed(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
        assert frame.cloud is not None
        xyz_m = change(frame.cloud.xyz_m).astype(np.float32)
        return rig, replace(frame, cloud=replace(frame.cloud, xyz_m=xyz_m))

    return changed


def focal(by: float) -> Case:
    """K and P are of a picture of another size."""

    def changed(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
        scale = np.diag([by, by, 1.0])
        return Rig(rig.lidar, tuple(replace(c, projection=scale @ c.projection) for c in rig.cameras)), frame

    return changed


ATTACKS: dict[str, Case] = {
    **{f"facula on S_{n}, R = {R} px": facula(n, R) for n in (1, 2, 3) for R in (187, 375)},
    "wall 2.5 m at 6 m": wall,
}

FAULTS: dict[str, Case] = {
    "centimetres": points(lambda xyz: xyz * np.float32(100)),
    "feet": points(lambda xyz: xyz * np.float32(3.28)),
    "x and y swapped": points(lambda xyz: xyz[:, [1, 0, 2]]),
    "y negated": points(lambda xyz: xyz * np.array([1, -1, 1], np.float32)),
    "z negated": points(lambda xyz: xyz * np.array([1, 1, -1], np.float32)),
    "random ranges": points(lambda xyz: xyz * _RNG.uniform(0.1, 2, (len(xyz), 1))),
    "focal length / 2": focal(0.5),
}


def withheld(case: Case, rig: Rig, some: Iterable[Frame]) -> tuple[str, list[float]]:
    """Why no verdict is given on a few frames, and how well their points fit."""
    check, fits = CalibrationMonitor(), []
    for frame in some:
        _, arrays = measure(*reversed(case(rig, frame)), SgbmMatcher())
        check.add(arrays, FaultFeatures().update(arrays))
        fits.append(geometry_fit(arrays).points)
    return check.withheld(), fits


def main() -> None:
    use_one_thread()
    for number in ("0009", "0001"):
        rig, stream = frames(number)
        some = list(islice(stream, 0, 11, 5))
        print(f"drive {number}, frames {[frame.number for frame in some]}")
        for name, case in {**WRONG_RIGS, **ATTACKS, **FAULTS}.items():
            why, fits = withheld(case, rig, some)
            print(f"  {name:24s} {' '.join(f'{fit:.2f}' for fit in fits):16s} {why.split(':')[0] or '-'}", flush=True)


if __name__ == "__main__":
    main()

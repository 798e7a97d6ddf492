"""The verdicts on attacks beyond the paper and on faults: `python -m tests.benchmarks.conditions`.

Every second frame of drive 0009 of the folder AUDITOR_TEST_DATA under each condition, n = 3, thresholds at r = 1 %
from the clean frames of drive 0001. Prints how often each verdict was given. Each frame is judged by itself: causes
that are not attacks and frozen sensors are left out, by which a scan recognises these faults.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import cv2
import numpy as np

from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.frames import CameraImage, Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.real_drives import frames
from tests.benchmarks.single_frames import judge_alone

MATCHER = find_matcher("sgbm")

Pixels = np.ndarray
Case = tuple[str, tuple[int, ...], Frame]

HALF_SECTOR = np.deg2rad(15)
STEP_PX, STRIPE = 20, 90


def pictures(pixels: Pixels, rng: np.random.Generator) -> Iterator[tuple[str, Pixels]]:
    """One camera's image under each condition."""
    height, width = pixels.shape[:2]
    beside = (slice(None), slice(None), *[None] * (pixels.ndim - 2))  # the same of every channel
    u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(187, 375)
    squared = (np.arange(width) - u) ** 2 + (np.arange(height)[:, None] - v) ** 2
    yield "dark spot, R 187 to 375 px", pixels * (1 - np.exp(-squared / (2 * (radius / 2) ** 2)))[beside]
    yield "black disc, R 187 to 375 px", np.where((squared < radius**2)[beside], 0, pixels)
    yield f"stripes of {STRIPE} grey levels", pixels + STRIPE * (np.arange(height)[:, None] // STEP_PX % 2)[beside]
    yield "noise of 40 grey levels", pixels + rng.normal(0, 40, pixels.shape)
    yield "shifted by 12 px", np.roll(pixels, 12, axis=1)
    yield "blurred over 15 px", cv2.blur(pixels, (15, 15))
    yield "a fifth of the light", pixels * 0.2


def clouds(xyz_m: Pixels, rng: np.random.Generator) -> Iterator[tuple[str, Pixels]]:
    """The LiDAR's points under each condition."""
    direction = np.arctan2(xyz_m[:, 1], xyz_m[:, 0])
    inside = np.abs(direction - rng.uniform(-0.5, 0.5)) < HALF_SECTOR
    yield "30 degrees moved out by 20 %", np.where(inside[:, None], xyz_m * 1.2, xyz_m)
    yield "30 degrees removed", xyz_m[~inside]
    c, s = np.cos(np.deg2rad(1)), np.sin(np.deg2rad(1))
    yield "turned by 1 degree (yaw)", xyz_m @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    yield "turned by 1 degree (pitch)", xyz_m @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T


def with_pixels(frame: Frame, change: Callable[[Pixels], Pixels], cameras: tuple[int, ...]) -> Frame:
    """The frame with some cameras' pictures changed."""
    changed = {
        c: CameraImage(c, frame.stamp_ns, np.clip(change(frame.images[c].pixels), 0, 255).astype(np.uint8))
        for c in cameras
    }
    return replace(frame, images={**frame.images, **changed})


def conditions(frame: Frame, before: Frame | None, rig: Rig) -> Iterator[Case]:
    """The frame under every condition, with the sensors that it affects."""
    rng = np.random.default_rng(frame.number)
    cameras = tuple(frame.images)
    for c in cameras:
        for name, pixels in pictures(frame.images[c].pixels, rng):
            yield name, (c,), with_pixels(frame, lambda _, pixels=pixels: pixels, (c,))
        if before is not None:
            yield "one frame late", (c,), replace(frame, images={**frame.images, c: before.images[c]})
    assert frame.cloud is not None
    for name, xyz_m in clouds(frame.cloud.xyz_m, rng):
        cloud = PointCloud(frame.stamp_ns, np.ascontiguousarray(xyz_m, dtype=np.float32))
        yield name, (LIDAR,), replace(frame, cloud=cloud)
    if before is not None:
        yield "one frame late", (LIDAR,), replace(frame, cloud=before.cloud)
    yield "a fifth of the light", cameras, with_pixels(frame, lambda p: p * 0.2, cameras)
    yield "noise of 15 grey levels", cameras, with_pixels(frame, lambda p: p + rng.normal(0, 15, p.shape), cameras)


def main() -> None:
    """Measure and print."""
    use_one_thread()
    rig, stream = frames("0001", colour=True)
    clean = [AttackedFrame(frame, rig, MATCHER).statistics({}) for frame in stream]
    statistics: list[tuple[float | None, ...]] = []
    happened: list[tuple[str, tuple[int, ...]]] = []
    rig, stream = frames("0009", colour=True)
    before: Frame | None = None
    for frame in stream:
        if frame.number % 2 == 0:
            for name, whom, changed in conditions(frame, before, rig):
                happened.append((name, whom))
                statistics.append(AttackedFrame(changed, rig, MATCHER).statistics({}))
        before = frame
    counted: dict[tuple[str, tuple[int, ...]], Counter[str]] = {}
    for what, verdict in zip(happened, judge_alone(rig, [clean], statistics), strict=True):
        text = " ".join([verdict.kind, *(f"S_{s}" for s in verdict.attacked)])
        counted.setdefault(what, Counter())[text] += 1
    for (name, whom), verdicts in counted.items():
        verdicts_of = ", ".join(f"{text} {count}" for text, count in verdicts.most_common())
        print(f"{name:30} {' '.join(f'S_{s}' for s in whom):12} {verdicts_of}")


if __name__ == "__main__":
    main()

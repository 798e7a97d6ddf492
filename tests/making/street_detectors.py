"""Training of the detectors that come with auditor, on synthetic streets and nothing else."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from auditor.lab.evaluation.object_baseline.detectors.streets import clouds, images
from auditor.lab.evaluation.object_baseline.detectors.streets.network import STRIDE, CentreNet
from auditor.lab.evaluation.object_baseline.kitti_labels import ObjectLabel
from auditor.lab.evaluation.object_baseline.runner import street_labels
from auditor.lab.evaluation.sources import Street
from auditor.model.arrays import Floats, Floats32, Image, Points

LEFT_OUT_STYLES, LEFT_OUT_CONDITIONS = ("industrial",), ("wet", "dusk")
"""Streets of these families are not trained on, so that they show what becomes of streets of another kind."""

_STREET_FRAMES = 60
_FIRST_STREET = 20_000  # far from those of an evaluation, and of a matcher's training
_AROUND_M = ((-40.0, 40.0), (-3.0, 3.5), (0.0, 60.0))
_UNIT_M = 0.005


@dataclass(frozen=True, eq=False)
class StreetFrame:
    """A frame to train on: a camera's picture as the network sees it, the points in the rig frame, and the truth.

    `points` are (N, 3), in units of _UNIT_M.
    """

    image: Image
    points: NDArray[np.int16]
    labels: tuple[ObjectLabel, ...]

    @property
    def xyz_m(self) -> Points:
        """(N, 3) points in the rig frame."""
        return self.points.astype(np.float32) * np.float32(_UNIT_M)


def families_trained_on(street: Street) -> bool:
    """True where a street is of a family that is trained on."""
    return street.style not in LEFT_OUT_STYLES and street.condition not in LEFT_OUT_CONDITIONS


def training_streets(count: int) -> list[Street]:
    """The first so many streets of the families that are trained on."""
    streets: list[Street] = []
    seed = _FIRST_STREET
    while len(streets) < count:
        street = Street(seed, _STREET_FRAMES)
        streets += [street] if families_trained_on(street) else []
        seed += 1
    return streets


def street_frames(street: Street, frames: int) -> Iterator[StreetFrame]:
    """So many frames spread over a street, each as one of its cameras sees it, in turn."""
    drive = street.drive
    assert drive.rig.lidar is not None
    motion = drive.rig.lidar.rig_SE3_lidar.astype(np.float32)
    for turn, number in enumerate(np.linspace(0, street.frames - 1, frames).astype(int).tolist()):
        camera = (street.seed + turn) % street.cameras + 1
        image = images.half(drive.image(number, camera).pixels)
        points = drive.cloud(number).xyz_m @ motion[:3, :3].T + motion[:3, 3]
        low, high = np.array(_AROUND_M, dtype=np.float32).T
        near = points[((points > low) & (points < high)).all(axis=1)]
        units = np.asarray(np.rint(near / _UNIT_M), dtype=np.int16)
        yield StreetFrame(image, units, street_labels(drive, number, camera))


Draw = Callable[[StreetFrame, np.random.Generator], tuple[Floats32, Floats, Floats, Floats]]
"""A varied input of a frame, (M, K) boxes, (M, 2) half sides in cells of the map, and (L, 4) what is not asked for."""

_CROP_PX = (160, 384)
_SCALES = (0.7, 1.5)
_GAMMAS, _GAINS, _OFFSETS, _NOISE = (0.6, 1.6), (0.7, 1.3), (-25.0, 25.0), (0.0, 6.0)
_LEAST_IN_CROP = 0.4
_HIDDEN = 3
_MOST_TRUNCATED = 0.6

_TURNS = math.radians(50)
_SIZES = (0.88, 1.12)
_LIFT_M = 0.2
_LOST = (0.0, 0.4)
_JITTER_M = 0.02
_ROAD_M, _WAIST_M, _CABIN_M = 1.65, 0.9, 0.7
_UPRIGHT = (0.0, 1.0)
_LEAST_POINTS = 10
_MARGIN_M = 0.1


def drawn_image(frame: StreetFrame, rng: np.random.Generator) -> tuple[Floats32, Floats, Floats, Floats]:
    """A window of the picture in another size and another light, half of them mirrored."""
    scale = math.exp(rng.uniform(*np.log(_SCALES)))
    image = images.resized(frame.image, scale)
    boxes = np.array([label.box_px for label in frame.labels]).reshape(-1, 4) * (scale / images.STEP)
    unwanted = np.array([label.occluded >= _HIDDEN or label.truncated > _MOST_TRUNCATED for label in frame.labels])
    if rng.random() < 0.5:
        boxes = np.stack([image.shape[1] - boxes[:, 2], boxes[:, 1], image.shape[1] - boxes[:, 0], boxes[:, 3]], axis=1)
        image = image[:, ::-1]
    spare = np.subtract(image.shape, _CROP_PX)
    top, left = (int(rng.integers(room + 1)) if room > 0 else 0 for room in spare)
    window = image[top : top + _CROP_PX[0], left : left + _CROP_PX[1]].astype(np.float32)
    window = np.pad(window, [(0, most - side) for most, side in zip(_CROP_PX, window.shape, strict=True)], mode="edge")
    moved = boxes - [left, top, left, top]
    inside = np.clip(moved, 0, [*_CROP_PX[::-1]] * 2)
    area, whole = (np.prod(of[:, 2:] - of[:, :2], axis=1) for of in (inside, moved))
    there = area > 0
    unwanted = unwanted.astype(bool) | (area < _LEAST_IN_CROP * whole)
    wanted = inside[there & ~unwanted]
    light = 255 * (window / 255) ** rng.uniform(*_GAMMAS) * rng.uniform(*_GAINS) + rng.uniform(*_OFFSETS)
    noisy = light + rng.normal(0, rng.uniform(*_NOISE), light.shape)
    grey_levels = np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)
    half_sides = (wanted[:, 2:] - wanted[:, :2])[:, ::-1] / (2 * STRIDE)
    return images.shown(grey_levels), wanted, half_sides, inside[there & unwanted][:, [1, 0, 3, 2]] / STRIDE


def drawn_cloud(frame: StreetFrame, rng: np.random.Generator) -> tuple[Floats32, Floats, Floats, Floats]:
    """The points seen from above, turned about the vehicle, in another size, half of them mirrored, some lost.

    All streets have saloons; what is above a car's waist is brought nearer, so that some have a van's upright back.
    """
    boxes = np.array([[*label.place_m, *label.size_m[::-1], label.yaw_rad] for label in frame.labels]).reshape(-1, 7)
    kept = rng.random(len(frame.points)) >= rng.uniform(*_LOST)
    points = frame.xyz_m[kept] + rng.normal(0, _JITTER_M, (int(kept.sum()), 3))
    points[:, 2] -= rng.uniform(*_UPRIGHT) * np.clip(_ROAD_M - points[:, 1] - _WAIST_M, 0, _CABIN_M)
    seen = np.array([_points_in(points, box) >= _LEAST_POINTS for box in boxes], dtype=np.bool_)
    turn, size, lift = rng.uniform(-_TURNS, _TURNS), rng.uniform(*_SIZES), rng.uniform(-_LIFT_M, _LIFT_M)
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    cos, sin = math.cos(turn), math.sin(turn)
    # A yaw turns x towards -z, and so does this.
    turned = np.array([[mirror * cos, 0, mirror * sin], [0, 1, 0], [-sin, 0, cos]]) * size
    points, places = points @ turned.T + [0, lift, 0], boxes[:, :3] @ turned.T + [0, lift, 0]
    yaw = boxes[:, 6] + turn
    boxes = np.column_stack([places, boxes[:, 3:6] * size, yaw if mirror > 0 else math.pi - yaw])
    span = clouds.CELLS * clouds.CELL_M
    row, column = places[:, 2] / clouds.CELL_M / STRIDE, (places[:, 0] + span / 2) / clouds.CELL_M / STRIDE
    cells = clouds.CELLS / STRIDE
    there = (row >= 0) & (row < cells) & (column >= 0) & (column < cells)
    wanted = there & seen
    reach = np.hypot(boxes[:, 3], boxes[:, 4]) / 2 / clouds.CELL_M / STRIDE
    around = np.stack([row - reach, column - reach, row + reach, column + reach], axis=1)
    half_sides = np.repeat(boxes[wanted, 4:5] / (2 * clouds.CELL_M * STRIDE), 2, axis=1)
    return clouds.shown(points.astype(np.float32)), boxes[wanted], half_sides, around[there & ~wanted]


def _points_in(points: Floats | Points, box: Floats) -> int:
    """How many points lie in a box, or hardly outside."""
    x, y, z, length, width, height, yaw = box
    right, ahead = points[:, 0] - x, points[:, 2] - z
    along, across = right * math.cos(yaw) - ahead * math.sin(yaw), right * math.sin(yaw) + ahead * math.cos(yaw)
    inside = (np.abs(along) < length / 2 + _MARGIN_M) & (np.abs(across) < width / 2 + _MARGIN_M)
    inside &= (points[:, 1] < y - _MARGIN_M) & (points[:, 1] > y - height - _MARGIN_M)
    return int(np.count_nonzero(inside))


@dataclass(frozen=True, eq=False)
class Kind:
    """What one of the two detectors is trained by."""

    new_network: Callable[[], CentreNet]
    drawn: Draw
    middles: Callable[[Floats], Floats]
    encoded: Callable[[Floats, Floats], Floats]


def _middles_in_image(boxes: Floats) -> Floats:
    return (boxes[:, :2] + boxes[:, 2:])[:, ::-1] / (2 * STRIDE)


def _middles_on_ground(boxes: Floats) -> Floats:
    step = clouds.CELL_M * STRIDE
    return np.stack([boxes[:, 2] / step, boxes[:, 0] / step + clouds.CELLS / (2 * STRIDE)], axis=1)


IMAGES = Kind(images.new_network, drawn_image, _middles_in_image, images.encoded)
CLOUDS = Kind(clouds.new_network, drawn_cloud, _middles_on_ground, clouds.encoded)


@dataclass(frozen=True)
class Training:
    """A training run: `steps` batches; the rate rises over the first tenth of them and falls along a cosine."""

    steps: int
    batch: int = 8
    rate: float = 3e-3
    seed: int = 0


_SPREAD = 0.35
_LEAST_SPREAD = 0.6
_BOX_WEIGHT = 1.0
_NEAR = 0.6


def trained(kind: Kind, frames: Sequence[StreetFrame], how: Training) -> Iterator[tuple[int, float, CentreNet]]:
    """Train a network; yields step, loss and the network after each step. The seed decides every draw."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(how.seed)
        network = kind.new_network().train()
    optimiser = torch.optim.AdamW(network.parameters(), lr=how.rate, weight_decay=1e-4)
    for step in range(how.steps):
        rng = np.random.default_rng([how.seed, step])
        batch = [_target(kind, frames[int(rng.integers(len(frames)))], rng) for _ in range(how.batch)]
        share = min(1.0, (step + 1) / max(how.steps // 10, 1))
        for group in optimiser.param_groups:
            group["lr"] = how.rate * share * 0.5 * (1 + math.cos(math.pi * step / how.steps))
        shown, heat, weight, numbers = (torch.from_numpy(np.stack(of)) for of in zip(*batch, strict=True))
        optimiser.zero_grad()
        loss = _loss(network(shown), heat, weight, numbers)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        yield step + 1, loss.item(), network


def _target(kind: Kind, frame: StreetFrame, rng: np.random.Generator) -> tuple[Floats32, Floats32, Floats32, Floats32]:
    """The input, (H, W) heat of middles, (H, W) weights, 0 where nothing is asked, and (1 + numbers, H, W) of boxes.

    The first of the latter is 1 near a middle, where a box is asked for.
    """
    shown, boxes, half_sides, unwanted = kind.drawn(frame, rng)
    height, width = (side // STRIDE for side in shown.shape[1:])
    rows, columns = np.mgrid[:height, :width]
    heat, weight = np.zeros((height, width), dtype=np.float32), np.ones((height, width), dtype=np.float32)
    cells = np.stack([rows.ravel(), columns.ravel()], axis=1).astype(np.float64)
    for top, left, bottom, right in unwanted:
        weight[max(int(top), 0) : int(bottom) + 1, max(int(left), 0) : int(right) + 1] = 0
    numbers = np.zeros((1 + kind.encoded(cells[:0], boxes[:0]).shape[1], height, width), dtype=np.float32)
    order = np.argsort(-half_sides.sum(axis=1), kind="stable")  # of two near one another the smaller is asked for
    for box, (row, column), sides in zip(boxes[order], kind.middles(boxes)[order], half_sides[order], strict=True):
        spread = np.maximum(sides * _SPREAD, _LEAST_SPREAD)
        away = ((rows + 0.5 - row) / spread[0]) ** 2 + ((columns + 0.5 - column) / spread[1]) ** 2
        here = np.exp(-away / 2).astype(np.float32)
        at = min(max(int(row), 0), height - 1), min(max(int(column), 0), width - 1)
        here[at] = 1
        heat, weight = np.maximum(heat, here), np.where(here > _NEAR, np.float32(1), weight)
        near = np.flatnonzero(here > _NEAR)
        numbers[0].ravel()[near] = 1
        numbers[1:].reshape(len(numbers) - 1, -1)[:, near] = kind.encoded(cells[near], np.tile(box, (len(near), 1))).T
    return shown, heat, weight, numbers


def _loss(answer: Tensor, heat: Tensor, weight: Tensor, numbers: Tensor) -> Tensor:
    """The focal loss of Zhou et al. for the middles, and the mean error of the boxes' numbers near them."""
    logit = answer[:, 0]
    sure = logit.sigmoid()
    is_middle = (heat == 1).float()
    found = -functional.logsigmoid(logit) * (1 - sure) ** 2 * is_middle
    raised = -functional.logsigmoid(-logit) * sure**2 * (1 - heat) ** 4 * (1 - is_middle)
    middles = ((found + raised) * weight).sum() / is_middle.sum().clamp(min=1)
    near = numbers[:, :1]
    boxes = (functional.smooth_l1_loss(answer[:, 1:], numbers[:, 1:], beta=0.1, reduction="none") * near).sum()
    return middles + _BOX_WEIGHT * boxes / near.sum().clamp(min=1)

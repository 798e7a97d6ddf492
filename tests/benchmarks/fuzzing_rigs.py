"""A mutation loop over whole vehicles: `python -m tests.benchmarks.fuzzing_rigs --iterations 50000`.

Every iteration makes the calibrations, pictures and transforms of a vehicle, sound ones with some numbers, names and
places exchanged for odd ones, and looks for rigs in them as an audit does: survey, rigs, their common views, and a
rectified picture of each. Anything raised but our own errors, every warning of Python or NumPy, and whatever computes
for more than --limit seconds is printed with the seed that repeats it (--seed N --iterations 1); the exit code is 1.
"""

import random
import sys
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from auditor.errors import AuditorError
from auditor.measurement.disparity.rectification import rectification
from auditor.model.frames import CameraImage, Message
from auditor.model.optics.common_view import common_view
from auditor.model.optics.geometry import Matrix, motion, quaternion_from_rotation
from auditor.model.rig import Rig
from auditor.recordings import check_rig, schemas, search_rigs, survey
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.messages import MessageMaker
from tests.benchmarks.fuzzing import looped, options_of

START_NS = 1_700_000_000 * 10**9
SIZE_PX = (64, 48)
FOCAL_PX = 50.0
MOST_PIXELS = 200_000
"""Larger pictures are sent without their data, and of larger views none is rectified: it would only take time."""

FEWEST_WITH_RIGS = 0.2
"""A smaller share of vehicles in which rigs are found, and the fuzzer looks at nothing but refusals."""

NUMBERS = (0.0, -1.0, 1.0, 0.5, 1e-9, 1e-300, 1e300, 1e9, -1e9, 1e6, 2.0**31, float("nan"), float("inf"), -float("inf"))
SIZES = (0, 1, 2, 31, 63, 64, 128, 640, 65_535, 65_536, 2**31, 2**32 - 1)
WORDS = ("", "/", "base", "cam0", "camera", "\0", "ä" * 50, "a\nb", "image_rect", "1e300")
MODELS = ("", "plumb_bob", "rational_polynomial", "equidistant", "fisheye", "none", "unknown", "PLUMB_BOB", "\0")


@dataclass
class Vehicle:
    """What a recording says of its sensors; every field may be odd."""

    cameras: list[dict[str, Any]]
    clouds: list[dict[str, Any]]
    transforms: list[dict[str, Any]]


@dataclass
class Remembered:
    """A recording of messages in memory."""

    maker: MessageMaker
    sent: list[Message] = field(default_factory=list)
    files: tuple[Path, ...] = ()

    def add(self, topic: str, schema: str, data: bytes) -> None:
        """Add a message."""
        self.sent.append(Message(topic, schema, "cdr", START_NS, data))

    def topics(self) -> tuple[Topic, ...]:
        """See recording.Recording."""
        known = {message.topic: Topic(message.topic, message.schema, "cdr") for message in self.sent}
        return tuple(topic for _, topic in sorted(known.items()))

    def definition(self, schema: str) -> Definition:
        """See recording.Recording."""
        return Definition("ros2msg", self.maker.definition(schema).encode())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """See recording.Recording."""
        return (message for message in self.sent if topics is None or message.topic in topics)


def sound_vehicle(rng: random.Random) -> Vehicle:
    """Two to six cameras on a line, in front or around the car, in P, in tf or both; with a LiDAR or without."""
    count, placing, rectified = (
        rng.randint(2, 6),
        rng.choice(("line", "line", "front", "front", "around")),
        rng.random() < 0.5,
    )
    cameras, transforms = [], []
    in_projection = placing == "line" and rng.random() < 0.5
    for number in range(count):
        name, place = f"cam{number}", _place(rng, number, count, placing)
        K = np.array([[FOCAL_PX, 0, 32], [0, FOCAL_PX, 24], [0, 0, 1]])
        offset = np.array([[-FOCAL_PX * place[0, 3]], [0], [0]]) if in_projection else np.zeros((3, 1))
        cameras.append(
            {
                "topic": f"/{name}/{'image_rect' if rectified else 'image_raw'}",
                "info": f"/{name}/camera_info",
                "frame": "rig" if in_projection else name,
                "picture": list(SIZE_PX),
                "size": list(SIZE_PX),
                "model": rng.choice(("plumb_bob", "equidistant", "rational_polynomial")),
                "D": [] if rectified else [rng.uniform(-0.05, 0.05) for _ in range(rng.choice((4, 4, 5, 8)))],
                "K": K.ravel().tolist(),
                "R": np.eye(3).ravel().tolist(),
                "P": np.hstack([K, offset]).ravel().tolist(),
                "roi": [0, 0, 0, 0],
                "binning": [0, 0],
            }
        )
        transforms.append(_transform("base", "rig" if in_projection else name, place))
    clouds = [{"topic": "/top/points", "frame": "top"}] if rng.random() < 0.6 else []
    transforms.append(_transform("base", "top", np.eye(4)))
    return Vehicle(cameras, clouds, transforms)


def _place(rng: random.Random, number: int, count: int, placing: str) -> Matrix:
    if placing == "line":
        return motion(np.eye(3), np.array([0.3 * number, 0, 0]))
    if placing == "front":
        return motion(np.eye(3), np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-0.1, 0.1)]))
    angle = 2 * np.pi * number / count
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return motion(turn, turn @ np.array([0, 0, 1.5]))


def _transform(parent: str, child: str, matrix: Matrix) -> dict[str, Any]:
    turn, move = quaternion_from_rotation(matrix[:3, :3]), matrix[:3, 3].tolist()
    return {"parent": parent, "child": child, "turn": list(turn), "move": move}


def mutate(vehicle: Vehicle, rng: random.Random) -> None:
    """One change of a number, a name, a size, a camera, or the tree."""
    changes = (_change_matrix, _change_matrix, _change_picture, _change_names, _change_transform, _grow)
    rng.choice(changes)(vehicle, rng)


def _change_matrix(vehicle: Vehicle, rng: random.Random) -> None:
    """One number or all of a matrix, the lens, or the same matrix in every camera."""
    camera, name = rng.choice(vehicle.cameras), rng.choice("KRPP")
    kind = rng.randrange(6)
    if kind < 2:
        camera[name][rng.randrange(len(camera[name]))] = _number(rng, camera[name])
    elif kind == 2:
        camera[name] = [_number(rng, camera[name]) for _ in camera[name]]
    elif kind == 3:
        camera["D"] = [_number(rng, [0.1]) for _ in range(rng.choice((0, 1, 3, 4, 5, 8, 12, 14, 100)))]
    elif kind == 4:
        camera["model"] = rng.choice(MODELS)
    else:
        for one in vehicle.cameras:
            one[name] = list(camera[name])


def _change_picture(vehicle: Vehicle, rng: random.Random) -> None:
    """Sizes, regions and binnings, sound ones and others."""
    camera, kind = rng.choice(vehicle.cameras), rng.randrange(4)
    if kind == 0:
        camera[rng.choice(("size", "picture"))] = [rng.choice(SIZES), rng.choice(SIZES)]
    elif kind == 1:
        camera["roi"], camera["binning"] = rng.choices(SIZES, k=4), rng.choices((0, 1, 2, 3, 64, 2**31), k=2)
    elif kind == 2:
        camera["roi"], camera["picture"] = [rng.randrange(32), rng.randrange(16), 32, 32], [32, 32]
    else:
        camera["binning"], camera["picture"] = [2, 1], [SIZE_PX[0] // 2, SIZE_PX[1]]


def _change_names(vehicle: Vehicle, rng: random.Random) -> None:
    """Frames and topics, odd ones and another camera's; or a camera that copies another."""
    camera, other = rng.choice(vehicle.cameras), rng.choice(vehicle.cameras)
    if rng.random() < 0.7:
        camera[rng.choice(("frame", "topic", "info"))] = rng.choice((*WORDS, other["frame"], other["topic"]))
    else:
        camera.update({name: other[name] for name in rng.sample(sorted(other), 4)})


def _change_transform(vehicle: Vehicle, rng: random.Random) -> None:
    """A number, or the name of a frame."""
    transform, camera = rng.choice(vehicle.transforms), rng.choice(vehicle.cameras)
    if rng.random() < 0.7:
        where = transform[rng.choice(("turn", "move"))]
        where[rng.randrange(len(where))] = _number(rng, where)
    else:
        transform[rng.choice(("parent", "child"))] = rng.choice((*WORDS, transform["child"], camera["frame"]))


def _grow(vehicle: Vehicle, rng: random.Random) -> None:
    """A long chain, a cycle, or many cameras."""
    kind = rng.randrange(3)
    if kind == 0:
        length = rng.choice((3, 30, 300))
        names = [f"link{number}" for number in range(length)]
        vehicle.transforms += [_transform(a, b, np.eye(4)) for a, b in pairwise(names)]
        vehicle.transforms += [_transform("base", names[0], np.eye(4)), _transform(names[-1], "cam0", np.eye(4))]
    elif kind == 1:
        frames = [camera["frame"] for camera in (*vehicle.cameras, vehicle.cameras[0])]
        vehicle.transforms += [_transform(a, b, np.eye(4)) for a, b in pairwise(frames)]
    else:
        for number in range(rng.randint(4, 12)):
            name, model = f"more{number}", rng.choice(vehicle.cameras)
            copy = {**model, "topic": f"/{name}/image_raw", "info": f"/{name}/camera_info", "frame": name}
            vehicle.cameras.append({key: list(it) if isinstance(it, list) else it for key, it in copy.items()})
            place = motion(np.eye(3), np.array([rng.uniform(-2, 2), rng.choice((0, 0, 1)), 0]))
            vehicle.transforms.append(_transform("base", name, place))


def _number(rng: random.Random, numbers: list[float]) -> float:
    choice = rng.random()
    if choice < 0.4:
        return rng.choice(NUMBERS)
    return rng.gauss(0, 1) if choice < 0.6 else rng.choice(numbers) * rng.choice((-1, 0.5, 1.001, 2, 10))


def recorded(vehicle: Vehicle, maker: MessageMaker) -> Remembered:
    """The messages of a vehicle; a picture's message holds no pixels."""
    recording = Remembered(maker)
    make = maker.store.types
    for camera in vehicle.cameras:
        header = maker.header(START_NS, camera["frame"])
        left, top, width, height = camera["roi"]
        region = make["sensor_msgs/msg/RegionOfInterest"](
            x_offset=_uint(left), y_offset=_uint(top), height=_uint(height), width=_uint(width), do_rectify=False
        )
        matrices = {name.lower(): np.array(camera[name], dtype=np.float64) for name in "DKRP"}
        info = make[schemas.CAMERA_INFO](
            header=header,
            width=_uint(camera["size"][0]),
            height=_uint(camera["size"][1]),
            distortion_model=camera["model"],
            **matrices,
            binning_x=_uint(camera["binning"][0]),
            binning_y=_uint(camera["binning"][1]),
            roi=region,
        )
        width, height = (_uint(side) for side in camera["picture"])
        picture = make[schemas.IMAGE](
            header=header,
            height=height,
            width=width,
            encoding="mono8",
            is_bigendian=0,
            step=width,
            data=np.zeros(width * height if width * height <= MOST_PIXELS else 0, np.uint8),
        )
        recording.add(camera["info"], schemas.CAMERA_INFO, maker.serialise(schemas.CAMERA_INFO, info))
        recording.add(camera["topic"], schemas.IMAGE, maker.serialise(schemas.IMAGE, picture))
    for cloud in vehicle.clouds:
        points = np.ones((5, 4), np.float32)
        recording.add(cloud["topic"], schemas.POINT_CLOUD, maker.point_cloud(points, START_NS, cloud["frame"]))
    stamped = [_stamped(maker, transform) for transform in vehicle.transforms]
    message = make[schemas.TRANSFORMS](transforms=stamped)
    recording.add("/tf_static", schemas.TRANSFORMS, maker.serialise(schemas.TRANSFORMS, message))
    return recording


def _stamped(maker: MessageMaker, transform: dict[str, Any]) -> object:
    make = maker.store.types
    return make["geometry_msgs/msg/TransformStamped"](
        header=maker.header(START_NS, transform["parent"]),
        child_frame_id=transform["child"],
        transform=make["geometry_msgs/msg/Transform"](
            translation=make["geometry_msgs/msg/Vector3"](**dict(zip("xyz", transform["move"], strict=True))),
            rotation=make["geometry_msgs/msg/Quaternion"](**dict(zip("xyzw", transform["turn"], strict=True))),
        ),
    )


def _uint(value: int) -> int:
    return min(value, 2**32 - 1)


def one(seed: int, maker: MessageMaker) -> str:
    """One iteration; how many rigs there were, or why there was none of them to be used."""
    rng = random.Random(seed)
    vehicle = sound_vehicle(rng)
    for _ in range(rng.choice((0, 1, 1, 2, 3, 5, 8))):
        mutate(vehicle, rng)
    surveyed = survey(recorded(vehicle, maker))  # type: ignore[arg-type]  # all of a recording that a survey reads
    found = search_rigs(surveyed)
    for rig in found.rigs:
        try:
            check_rig(rig, surveyed)
            _rectify(rig)
        except AuditorError:
            return "refused"
    return f"{min(len(found.rigs), 3)} rigs"


def _rectify(rig: Rig) -> None:
    """Rectify a picture of each camera that is small, as a scan would."""
    assert rig.kind.matches(rig.kind)
    assert rig.rig_id == Rig.from_dict(rig.to_dict()).rig_id
    sides = [(camera.width_px, camera.height_px) for camera in rig.cameras]
    if not rig.is_rectified:
        shared = common_view(rig).rig.camera(1)
        sides.append((shared.width_px, shared.height_px))
        if not rig.shares_view:
            views = [common_view(rig.pair(*pair), widest=True).rig.camera(1) for pair in rig.pairs]
            sides += [(view.width_px, view.height_px) for view in views]
    if max((width * height for width, height in sides), default=0) > MOST_PIXELS:
        return
    rectified = rectification(rig)
    for camera in rig.cameras:
        pixels = np.zeros((camera.height_px, camera.width_px), np.uint8)
        rectified.image(CameraImage(camera.number, START_NS, pixels))


def run(first: int, count: int, limit_s: float) -> bool:
    """Run and print; True where nothing was found, and rigs were found in enough vehicles to say so."""
    maker = MessageMaker("cdr")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found, ends = looped(range(first, first + count), limit_s, lambda seed: one(seed, maker))
    with_rigs = sum(number for name, number in ends.items() if name.endswith("rigs") and name != "0 rigs")
    if with_rigs < FEWEST_WITH_RIGS * count:
        print(f"only {with_rigs} vehicles have rigs: the fuzzer makes nothing that could be audited")
    return found == 0 and with_rigs >= FEWEST_WITH_RIGS * count


def main() -> None:
    """Measure and print."""
    options = options_of(__doc__, 5_000).parse_args()
    cv2.setNumThreads(1)
    sys.exit(0 if run(options.seed, options.iterations, options.limit) else 1)


if __name__ == "__main__":
    main()

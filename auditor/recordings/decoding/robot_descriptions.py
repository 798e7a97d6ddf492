"""URDF: the description of a robot that ROS publishes as a string, by default on /robot_description.

Of it only the joints that cannot move are read: they say where frames sit. The text may not declare entities, which are
what makes a small XML file large.
"""

from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix, motion
from auditor.recordings import schemas
from auditor.recordings.decoding.geometry import ABSURD
from auditor.recordings.decoding.interface import Transform
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import Topic
from auditor.safety.budget import MAX_DESCRIPTION_BYTES, MAX_TRANSFORMS

_NAME = "robot_description"


def describes_robot(topic: Topic) -> bool:
    """True for a topic that holds a robot's description by its name and type."""
    return topic.schema == schemas.STRING and topic.name.rpartition("/")[2] == _NAME


def fixed_joints(message: Message, types: RosTypes) -> tuple[Transform, ...]:
    """Where frames sit that cannot move, by a message with a description. Raises DecodingError."""
    text = types.decode(message).data
    if len(text) > MAX_DESCRIPTION_BYTES:
        raise DecodingError(f"a description of {len(text)} characters is not accepted", where=message.topic)
    if "<!" in text.replace("<!--", ""):
        raise DecodingError("a description that declares more than comments is not accepted", where=message.topic)
    try:
        joints = list(_joints(ElementTree.fromstring(text)))  # noqa: S314  # it declares no entities
    except (ElementTree.ParseError, ValueError) as error:
        raise DecodingError(f"the description is ill-formed ({error})", where=message.topic) from error
    return tuple(joints[:MAX_TRANSFORMS])


def _joints(robot: ElementTree.Element) -> Iterator[Transform]:
    for joint in robot.iterfind("joint"):
        parent, child, origin = (joint.find(name) for name in ("parent", "child", "origin"))
        if joint.get("type") != "fixed" or parent is None or child is None:
            continue
        xyz_m, angles = ("0 0 0", "0 0 0") if origin is None else (origin.get(key, "0 0 0") for key in ("xyz", "rpy"))
        place = motion(rotation_of(*_three(angles)), _three(xyz_m))
        yield Transform(parent.get("link", "").lstrip("/"), child.get("link", "").lstrip("/"), place)


def _three(text: str) -> Matrix:
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.all(np.abs(numbers) < ABSURD):
        raise ValueError(f"{text[:40]!r} is not three numbers")
    return numbers


def rotation_of(roll: float, pitch: float, yaw: float) -> Matrix:
    """(3, 3): about the fixed x, then y, then z axis."""
    (a, b, c), (d, e, f) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    about_y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    about_z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    rotation: Matrix = about_z @ about_y @ about_x
    return rotation

"""The sidecar: what was found, as an MCAP file on the recording's timeline, for viewers of recordings.

All are Foxglove's messages. The event, the log, the damaged portions in the images and the box in the cloud are JSON;
the images with overlays and the damaged points are protobuf, which Rerun draws as well.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auditor.casefile.case import Case, in_words
from auditor.model.arrays import Points
from auditor.model.measurement import Region
from auditor.model.optics.geometry import quaternion_from_rotation
from auditor.model.pictures import FramePicture
from auditor.recordings.decoding.foxglove_layouts import COMPRESSED_IMAGE, POINT_CLOUD
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import McapFile, mcap_file
from auditor.recordings.writers.messages import FLOAT32, descriptors, protobuf
from auditor.reporting.incident.incident import Incident

SIDECAR = "findings.mcap"
PREFIX = "/auditor"
_WARNING, _ERROR = 3, 4  # levels of foxglove.Log
_LINE_LOOP = 2  # a type of foxglove.PointsAnnotation
_RED = {"r": 1.0, "g": 0.15, "b": 0.15, "a": 1.0}
_GLASS = {"r": 1.0, "g": 0.15, "b": 0.15, "a": 0.35}
_BOX_LASTS_NS = 200_000_000
_STRIDE_BYTES = 12
_IN_PLACE = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


@dataclass(frozen=True, eq=False)
class SidecarFrame:
    """One frame as the sidecar shows it, `log_time_ns` its place on the recording's timeline.

    `overlays` are pictures of cameras, JPEG; `damaged_m` (N, 3) are damaged points by LiDAR, in its frame.
    """

    stamp_ns: int
    log_time_ns: int
    message: str
    in_incident: bool
    regions: tuple[Region, ...] = ()
    overlays: tuple[FramePicture, ...] = ()
    damaged_m: Mapping[int, Points] = field(default_factory=dict)


def write_sidecar(case: Case, frames: Iterable[SidecarFrame], frame_ids: Mapping[int, str]) -> None:
    """Write the messages of frames, in their order.

    `frame_ids` are those of the sensors in the recording. Raises RecordingError.
    """
    incident = case.incident
    with mcap_file(case.folder / SIDECAR, profile="", compression="zstd") as file:
        writer = _Writer(file)
        for number, frame in enumerate(frames):
            if number == 0:
                writer.json("event", "foxglove.Event", frame.log_time_ns, _event(incident))
                writer.json("log", "foxglove.Log", frame.log_time_ns, _log(frame, case.evidence, _WARNING))
            _write_frame(incident, writer, frame, frame_ids)
        file.add_metadata({"incident_id": incident.incident_id, "source": incident.recording.recording_id})


class _Writer:
    """Writes messages under the topics of the sidecar."""

    def __init__(self, file: McapFile) -> None:
        self._file = file

    def json(self, topic: str, schema: str, log_time_ns: int, message: Mapping[str, Any]) -> None:
        """A message of Foxglove's in JSON."""
        definition = Definition("jsonschema", json.dumps(SCHEMAS[schema]).encode())
        self._write(Topic(f"{PREFIX}/{topic}", schema, "json"), definition, log_time_ns, json.dumps(message).encode())

    def protobuf(self, topic: str, schema: str, log_time_ns: int, message: Mapping[str, Any]) -> None:
        """A message of Foxglove's in protobuf."""
        definition = Definition("protobuf", descriptors(schema))
        self._write(Topic(f"{PREFIX}/{topic}", schema, "protobuf"), definition, log_time_ns, protobuf(schema, message))

    def _write(self, topic: Topic, definition: Definition, log_time_ns: int, data: bytes) -> None:
        self._file.write(topic, definition, log_time_ns, data)


def _write_frame(incident: Incident, writer: _Writer, frame: SidecarFrame, frame_ids: Mapping[int, str]) -> None:
    at = frame.log_time_ns
    if frame.in_incident:
        writer.json("log", "foxglove.Log", at, _log(frame, frame.message, _ERROR))
    for view in sorted({region.view for region in frame.regions if region.mask}):
        of_view = [region for region in frame.regions if region.view == view]
        writer.json(f"S_{view}/annotations", "foxglove.ImageAnnotations", at, _annotations(frame, of_view))
    for sensor in sorted({region.sensor for region in frame.regions if region.solid is not None}):
        of_lidar = [region for region in frame.regions if region.sensor == sensor and region.solid is not None]
        entities = [_entity(frame, place, one, incident, frame_ids[sensor]) for place, one in enumerate(of_lidar)]
        writer.json(f"S_{sensor}/box", "foxglove.SceneUpdate", at, {"deletions": [], "entities": entities})
    for picture in frame.overlays:
        image = {
            "timestamp": _timestamp(frame.stamp_ns),
            "data": picture.data,
            "format": "jpeg",
            "frame_id": frame_ids[picture.sensor],
        }
        writer.protobuf(f"S_{picture.sensor}/overlay", COMPRESSED_IMAGE, at, image)
    for sensor, points_m in frame.damaged_m.items():
        if len(points_m):
            cloud = _cloud(points_m, frame.stamp_ns, frame_ids[sensor])
            writer.protobuf(f"S_{sensor}/damaged", POINT_CLOUD, at, cloud)


def _time(ns: int) -> dict[str, int]:
    return {"sec": ns // 10**9, "nsec": ns % 10**9}


def _timestamp(ns: int) -> dict[str, int]:
    """As protobuf has it."""
    return {"seconds": ns // 10**9, "nanos": ns % 10**9}


def _cloud(points_m: Points, stamp_ns: int, frame_id: str) -> dict[str, Any]:
    """A foxglove.PointCloud of (N, 3) points."""
    return {
        "timestamp": _timestamp(stamp_ns),
        "frame_id": frame_id,
        "pose": _IN_PLACE,
        "point_stride": _STRIDE_BYTES,
        "fields": [{"name": axis, "offset": 4 * place, "type": FLOAT32} for place, axis in enumerate("xyz")],
        "data": points_m.astype("<f4").tobytes(),
    }


def _event(incident: Incident) -> dict[str, Any]:
    row = incident.row
    pairs = {
        "incident_id": incident.incident_id,
        "kind": row["kind"],
        "sensors": ", ".join(f"S_{sensor}" for sensor in incident.attacked),
        "frames": str(row["frames"]),
    }
    return {
        "start_time": _time(incident.part["from_ns"]),
        "end_time": _time(incident.part["to_ns"]),
        "metadata": [{"key": key, "value": value} for key, value in pairs.items()],
    }


def _log(frame: SidecarFrame, message: str, level: int) -> dict[str, Any]:
    return {
        "timestamp": _time(frame.stamp_ns),
        "level": level,
        "message": message,
        "name": "auditor",
        "file": "",
        "line": 0,
    }


def _annotations(frame: SidecarFrame, regions: list[Region]) -> dict[str, Any]:
    at = _time(frame.stamp_ns)
    points, texts = [], []
    for region in regions:
        left, top, right, bottom = region.box_px
        corners = ((left, top), (right, top), (right, bottom), (left, bottom))
        points.append(
            {
                "timestamp": at,
                "type": _LINE_LOOP,
                "points": [{"x": x, "y": y} for x, y in corners],
                "outline_color": _RED,
                "outline_colors": [],
                "fill_color": {**_RED, "a": 0.0},
                "thickness": 2.0,
            }
        )
        texts.append(
            {
                "timestamp": at,
                "position": {"x": left, "y": top},
                "text": f"{in_words(region.sensor)}: {100 * region.share:.0f} % damaged",
                "font_size": 14.0,
                "text_color": {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0},
                "background_color": _RED,
            }
        )
    return {"circles": [], "points": points, "texts": texts}


def _entity(frame: SidecarFrame, place: int, region: Region, incident: Incident, frame_id: str) -> dict[str, Any]:
    """A box around the damaged points; Foxglove's cubes are turned by a quaternion in the frame of the LiDAR."""
    assert region.solid is not None
    x, y, z = region.solid.centre_m
    pose = {"position": {"x": x, "y": y, "z": z}, "orientation": _orientation(region, incident)}
    width, height, depth = region.solid.size_m
    cube = {"pose": pose, "size": {"x": width, "y": height, "z": depth}, "color": _GLASS}
    return {
        "timestamp": _time(frame.stamp_ns),
        "frame_id": frame_id,
        "id": f"damaged {place}" if place else "damaged",
        "lifetime": _time(_BOX_LASTS_NS),
        "frame_locked": True,
        "metadata": [],
        "arrows": [],
        "cubes": [cube],
        "spheres": [],
        "cylinders": [],
        "lines": [],
        "triangles": [],
        "texts": [],
        "models": [],
    }


def _orientation(region: Region, incident: Incident) -> dict[str, float]:
    """The quaternion from the box's own axes (width, height, depth) to the LiDAR's."""
    assert region.solid is not None
    turn = np.deg2rad(region.solid.yaw_deg)
    # In the rig (right, down, forward) the depth points `turn` to the right of straight ahead.
    rig_R_box = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    lidar_R_box = incident.rig.lidars[region.sensor].rig_SE3_lidar[:3, :3].T @ rig_R_box
    x, y, z, w = quaternion_from_rotation(lidar_R_box)
    return {"x": float(x), "y": float(y), "z": float(z), "w": float(w)}


Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_TEXT: Schema = {"type": "string"}


def _object(title: str = "", **properties: Schema) -> Schema:
    named = {"title": title} if title else {}
    return {"type": "object", **named, "properties": properties}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


_TIME = _object("time", sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0})
_DURATION = _object("duration", sec={"type": "integer"}, nsec={"type": "integer", "minimum": 0})
_COLOUR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_POINT2 = _object("foxglove.Point2", x=_NUMBER, y=_NUMBER)
_VECTOR3 = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR3, orientation=_QUATERNION)
_PAIR = _object("foxglove.KeyValuePair", key=_TEXT, value=_TEXT)
_NONE = _list({"type": "object"})
"""A list of what no sidecar has, such as arrows."""

_POINTS = _object(
    "foxglove.PointsAnnotation",
    timestamp=_TIME,
    type={"type": "integer"},
    points=_list(_POINT2),
    outline_color=_COLOUR,
    outline_colors=_list(_COLOUR),
    fill_color=_COLOUR,
    thickness=_NUMBER,
)
_TEXTS = _object(
    "foxglove.TextAnnotation",
    timestamp=_TIME,
    position=_POINT2,
    text=_TEXT,
    font_size=_NUMBER,
    text_color=_COLOUR,
    background_color=_COLOUR,
)
_CUBE = _object("foxglove.CubePrimitive", pose=_POSE, size=_VECTOR3, color=_COLOUR)
_ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked={"type": "boolean"},
    metadata=_list(_PAIR),
    arrows=_NONE,
    cubes=_list(_CUBE),
    spheres=_NONE,
    cylinders=_NONE,
    lines=_NONE,
    triangles=_NONE,
    texts=_NONE,
    models=_NONE,
)

SCHEMAS: dict[str, Schema] = {
    "foxglove.Event": _object("foxglove.Event", start_time=_TIME, end_time=_TIME, metadata=_list(_PAIR)),
    "foxglove.Log": _object(
        "foxglove.Log",
        timestamp=_TIME,
        level={"type": "integer"},
        message=_TEXT,
        name=_TEXT,
        file=_TEXT,
        line={"type": "integer", "minimum": 0},
    ),
    "foxglove.ImageAnnotations": _object(
        "foxglove.ImageAnnotations", circles=_NONE, points=_list(_POINTS), texts=_list(_TEXTS)
    ),
    "foxglove.SceneUpdate": _object("foxglove.SceneUpdate", deletions=_NONE, entities=_list(_ENTITY)),
}
"""By the name of the message."""

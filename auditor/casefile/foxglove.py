"""The JSON schemas of those of Foxglove's messages that a sidecar has, with the names that viewers know them by."""

from typing import Any

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

"""Parses the definitions of the messages that our writers write; a process keeps what it has parsed."""

from auditor.recordings import schemas
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker

_SENSORS = (
    schemas.IMAGE,
    schemas.COMPRESSED_IMAGE,
    schemas.CAMERA_INFO,
    schemas.POINT_CLOUD,
    schemas.TRANSFORMS,
)


def _definition(schema: str) -> Definition:
    return Definition("ros2msg", MessageMaker("cdr").definition(schema).encode())


for _schema in _SENSORS:
    RosTypes(_definition).store(_schema, "cdr")

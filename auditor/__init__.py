"""Detect and identify optical attacks on cameras and LiDAR in recorded drives.

    import auditor

    for result in auditor.scan("logs/", store="audit", r="0.01"):
        print(result.recording, result.error or ("attacked" if result.found else "nothing found"))

The functions take plain arguments; their keywords have the names and defaults of the options of the command line.
Every error that is raised on purpose is an AuditorError. docs/python.md shows how to use them.

Stability: from version 1.0 on, semantic versioning holds for the names in `__all__`, for the columns of the views and
for the entry points `auditor.readers`, `auditor.decoders` and `auditor.matchers`. Before that, a minor version may
change them, and CHANGELOG.md says so. Every other module may change at any time.

Names are imported when they are first used, so that `import auditor` itself takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from auditor.errors import (
        AuditorError,
        DecodingError,
        LimitError,
        QueryError,
        RecordingError,
        RigError,
        SettingError,
        StoreError,
        ThresholdsError,
    )
    from auditor.measurement.disparity.matchers import Matcher, MatcherOptions
    from auditor.model.calibration import Calibration
    from auditor.model.frames import (
        CameraImage,
        Frame,
        Message,
        PointCloud,
        Presence,
        SensorState,
        SkippedFrame,
    )
    from auditor.model.measurement import Counts, Coverage, Measurement, Statistic
    from auditor.model.rig import LIDAR, Camera, Lidar, Rig, Triple
    from auditor.model.verdict import AttackLabel, Method, Verdict, VerdictKind
    from auditor.pipeline.asking import OpenedStore, open_store, query
    from auditor.pipeline.judged import JudgeResult
    from auditor.pipeline.library import (
        CalibrationResult,
        ScanResult,
        calibrate,
        find_rigs,
        judge,
        measure,
        open_recording,
        scan,
        synchronise,
    )
    from auditor.recordings import Damage, FrameStream, Reader, Recording, Topic
    from auditor.reporting.incident.render import render_incident_report
    from auditor.store.export import rows_of
    from auditor.store.records import StoredJudgement, StoredMeasurement
    from auditor.store.store import Store

__version__ = "0.3.0.dev0"

__all__ = [
    "LIDAR",
    "AttackLabel",
    "AuditorError",
    "Calibration",
    "CalibrationResult",
    "Camera",
    "CameraImage",
    "Counts",
    "Coverage",
    "Damage",
    "DecodingError",
    "Frame",
    "FrameStream",
    "JudgeResult",
    "Lidar",
    "LimitError",
    "Matcher",
    "MatcherOptions",
    "Measurement",
    "Message",
    "Method",
    "OpenedStore",
    "PointCloud",
    "Presence",
    "QueryError",
    "Reader",
    "Recording",
    "RecordingError",
    "Rig",
    "RigError",
    "ScanResult",
    "SensorState",
    "SettingError",
    "SkippedFrame",
    "Statistic",
    "Store",
    "StoreError",
    "StoredJudgement",
    "StoredMeasurement",
    "ThresholdsError",
    "Topic",
    "Triple",
    "Verdict",
    "VerdictKind",
    "__version__",
    "calibrate",
    "find_rigs",
    "judge",
    "measure",
    "open_recording",
    "open_store",
    "query",
    "render_incident_report",
    "rows_of",
    "scan",
    "synchronise",
]

_HOMES = {
    "errors": "AuditorError DecodingError LimitError QueryError RecordingError RigError SettingError StoreError "
    "ThresholdsError",
    "measurement.disparity.matchers": "Matcher MatcherOptions",
    "model.calibration": "Calibration",
    "model.frames": "CameraImage Frame Message PointCloud Presence SensorState SkippedFrame",
    "model.measurement": "Counts Coverage Measurement Statistic",
    "model.rig": "LIDAR Camera Lidar Rig Triple",
    "model.verdict": "AttackLabel Method Verdict VerdictKind",
    "pipeline.asking": "OpenedStore open_store query",
    "pipeline.library": "CalibrationResult ScanResult calibrate find_rigs judge measure open_recording scan "
    "synchronise",
    "pipeline.judged": "JudgeResult",
    "recordings": "Damage FrameStream Reader Recording Topic",
    "reporting.incident.render": "render_incident_report",
    "store.export": "rows_of",
    "store.records": "StoredJudgement StoredMeasurement",
    "store.store": "Store",
}
"""The module of each name."""


def __getattr__(name: str) -> object:
    for module, names in _HOMES.items():
        if name in names.split():
            return globals().setdefault(name, getattr(import_module(f"auditor.{module}"), name))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

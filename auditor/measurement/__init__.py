"""Measuring: a frame becomes disparity maps, and these become counts and statistics."""

import cv2

from auditor.measurement.fault_features.calibration_check import CalibrationMonitor
from auditor.measurement.fault_features.collect import FaultFeatures, RepeatedData
from auditor.measurement.fault_features.fewer_returns import FewerReturns
from auditor.measurement.fault_features.geometry_fit import FrameFit, fit_of_sides, geometry_fit, views_of_sides
from auditor.measurement.frame import measure, measure_stream
from auditor.measurement.localisation.regions import localise
from auditor.measurement.shared_view import FrameArrays
from auditor.measurement.thumbnails import PictureBook, draw


def use_one_thread() -> None:
    """Keep OpenCV to one thread: SGBM gains nothing from more, and recordings are measured side by side."""
    cv2.setNumThreads(1)


def instruction_sets() -> str:
    """The CPU's instruction sets that OpenCV uses here: with others the same frame may give slightly other counts."""
    return cv2.getCPUFeaturesLine()


__all__ = [
    "CalibrationMonitor",
    "FaultFeatures",
    "FewerReturns",
    "FrameArrays",
    "FrameFit",
    "PictureBook",
    "RepeatedData",
    "draw",
    "fit_of_sides",
    "geometry_fit",
    "instruction_sets",
    "localise",
    "measure",
    "measure_stream",
    "use_one_thread",
    "views_of_sides",
]

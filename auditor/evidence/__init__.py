"""SEE: a frame becomes disparity maps, and those become counts of inconsistent pixels."""

import cv2

from auditor.evidence.fitting import Fitting
from auditor.evidence.localising import localise
from auditor.evidence.measuring import measure, measure_stream
from auditor.evidence.one_view import Evidence
from auditor.evidence.pictures import Picture, PictureBook, draw
from auditor.evidence.watching import Watch


def use_one_thread() -> None:
    """Keep OpenCV to one thread: SGBM gains nothing from more, and recordings are measured side by side."""
    cv2.setNumThreads(1)


__all__ = [
    "Evidence",
    "Fitting",
    "Picture",
    "PictureBook",
    "Watch",
    "draw",
    "localise",
    "measure",
    "measure_stream",
    "use_one_thread",
]

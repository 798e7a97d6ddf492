"""Before any verdict: which way to read a recording's calibrations its images and points fit, if they fit any."""

from auditor.pipeline.geometry.gate import (
    FirstFrames,
    RigDoubts,
    doubts_of,
    first_frames_of,
    in_force,
    rigs_of,
    rigs_through,
    rigs_to_begin_with,
)

__all__ = (
    "FirstFrames",
    "RigDoubts",
    "doubts_of",
    "first_frames_of",
    "in_force",
    "rigs_of",
    "rigs_through",
    "rigs_to_begin_with",
)

"""How well a way to read calibrations fits: some frames of a recording are measured with the rig that it gives."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from auditor.measurement import FrameArrays, FrameFit, geometry_fit, measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.fault_features.geometry_fit import better_quarter
from auditor.measurement.warning_parameters import GEOMETRY_FIT
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import Recording, Survey, synchronise
from auditor.recordings.rigs.changes import WHOLE, Stretch

_MOST_CHECKED = 6  # frames by which ways to read a calibration are compared: it bounds the work
_EVERY_CHECKED = 4  # frames, of which one is compared so: it bounds the work


class Candidate(NamedTuple):
    """A way to read the calibrations, and how well LiDAR points and images fit the rig that it gives.

    Both are shares, NaN where they are not known.
    """

    survey: Survey
    points: float
    pictures: float


def best_of(candidates: Sequence[Candidate]) -> tuple[Candidate, float]:
    """The best one and its fit; the first, where none fits clearly better."""
    # Points that can be compared by one way and by no region of another do not fit the latter.
    by_points = not all(np.isnan(one.points) for one in candidates)
    fits = [np.nan_to_num(one.points if by_points else one.pictures) for one in candidates]
    highest = int(np.argmax(fits))
    chosen = highest if fits[highest] - fits[0] >= GEOMETRY_FIT.better_by else 0
    return candidates[chosen], float(fits[chosen])


def candidate_of(recording: Recording, survey: Survey, rig: Rig, stretches: Sequence[Stretch] = WHOLE) -> Candidate:
    """How well a rig of a survey fits some of the first frames of some stretches, in the better ones."""
    fits = fits_of(checked_frames(recording, survey, rig, stretches), rig)
    return Candidate(survey, better_quarter([one.points for one in fits]), better_quarter([o.pictures for o in fits]))


def fits_of(frames: Iterable[Frame], rig: Rig) -> list[FrameFit]:
    """How well each frame fits a rig."""
    return [geometry_fit(arrays) for arrays in measured_frames(frames, rig)]


def measured_frames(frames: Iterable[Frame], rig: Rig) -> Iterator[FrameArrays]:
    """What is measured of frames to compare them with a rig."""
    use_one_thread()
    matcher = find_matcher("sgbm")
    return (measure(frame, rig, matcher)[1] for frame in frames)


def checked_frames(
    recording: Recording, survey: Survey, rig: Rig, stretches: Sequence[Stretch] = WHOLE
) -> Iterator[Frame]:
    """Some of the first frames of some stretches of a recording."""
    stream = synchronise(recording, rig, survey, stretches=stretches)
    frames = (frame for frame in stream if isinstance(frame, Frame))
    every = _EVERY_CHECKED
    yield from islice(frames, 0, every * _MOST_CHECKED, every)

"""Before any verdict: where a recording's calibrations contradict themselves, its images and points say which is right.

Each way to read them gives a rig, and a few frames are measured with it. One that fits, where the others do not, is
taken and said. Where none fits, no verdict is given. What the first frames, or all of them, have to say against a rig
is said beside its verdicts.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auditor.errors import RigError
from auditor.measurement import (
    CalibrationMonitor,
    FaultFeatures,
    fit_of_sides,
    measure_stream,
    use_one_thread,
    views_of_sides,
)
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.fault_features.geometry_fit import better_quarter
from auditor.measurement.warning_parameters import GEOMETRY_FIT
from auditor.model.checks import pasts_of
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import Statistic
from auditor.model.rig import Rig
from auditor.pipeline.geometry.candidates import (
    Candidate,
    best_of,
    candidate_of,
    checked_frames,
    fits_of,
    measured_frames,
)
from auditor.pipeline.geometry.corrections import with_fitting_rigs
from auditor.recordings import (
    Changes,
    Contradictions,
    FrameStream,
    Positions,
    Recording,
    RigInForce,
    RigsInForce,
    Survey,
    ZeroLens,
    contradictions,
    find_rigs,
    given_rig,
    read_by,
    rigs_in_force,
    rigs_unless_changed,
    search_rigs,
    survey,
    synchronise,
    zero_lenses,
)

_REPAIR = "correct it in the recording's calibration, or give a rig file (--rig)"

_OTHER_WAYS_UP = {
    "turned by half": (slice(None, None, -1), slice(None, None, -1)),
    "mirrored": (slice(None), slice(None, None, -1)),
    "read from their last row to the first": (slice(None, None, -1), slice(None)),
}
"""Rows and columns of a picture as cameras that hang upside down, webcams and simulators may give them."""

_CALIBRATION_FRAMES = (0, 11, 5)  # first, end and step
_SUCCESSIVE_FRAMES = (0, 4, 1)  # of a lone camera: each is compared with the one before


def settled_rigs(recording: Recording, surveyed: Survey) -> RigsInForce:
    """The rigs of a recording by the way of reading its calibrations that its images and points fit.

    Raises RigError where there is no rig.
    """
    doubted = zero_lenses(surveyed)
    if doubted:
        settled, remark = _settled_lens(recording, surveyed, doubted)
        rigs = _settled_places(recording, settled)
        return rigs._replace(repairs=(*remark, *rigs.repairs))
    return _settled_places(recording, surveyed)


def _settled_lens(recording: Recording, surveyed: Survey, doubted: Mapping[str, str]) -> tuple[Survey, tuple[str, ...]]:
    """The survey with the reading of lenses, named with coefficients of 0, that points and images fit; a remark on it.

    Where they do not tell the cameras are left out: read wrongly, a lens makes every frame look attacked.
    """
    read = {lens: read_by(surveyed, replace(surveyed.conventions, zero_lens=lens)) for lens in ZeroLens}
    named, none = (_sides(recording, read[lens], doubted) for lens in (ZeroLens.NAMED, ZeroLens.NONE))
    if named - none >= GEOMETRY_FIT.sides_better_by:
        return surveyed, ()
    if none - named >= GEOMETRY_FIT.sides_better_by:
        remark = f"{next(iter(doubted.values()))}: none was taken, for so the images and points fit"
        return read[ZeroLens.NONE], (remark,)
    return read[ZeroLens.LEFT_OUT], ()


def _sides(recording: Recording, surveyed: Survey, topics: Mapping[str, str]) -> float:
    """How well the sides of the views fit, of the first rig with stereo and a LiDAR that has a camera of these topics.

    NaN where no rig has.
    """
    for rig in search_rigs(surveyed).rigs:
        if rig.lidar is not None and rig.n > 1 and any(camera.topic in topics for camera in rig.cameras):
            measured = measured_frames(checked_frames(recording, surveyed, rig), rig)
            return better_quarter([fit_of_sides(arrays, views_of_sides(arrays)) for arrays in measured])
    return float("nan")


def _settled_places(recording: Recording, surveyed: Survey) -> RigsInForce:
    """As `settled_rigs`, whatever the lenses."""
    disagreements = contradictions(surveyed)
    if not (disagreements.sentences or disagreements.doubts):
        return _rigs_in_force(recording, surveyed)
    candidates = _candidates(recording, surveyed, disagreements)
    best, fit = best_of(candidates)
    if fit < GEOMETRY_FIT.fits and not disagreements.sentences:
        return _rigs_in_force(recording, surveyed)
    rigs = _rigs_in_force(recording, best.survey)
    if fit < GEOMETRY_FIT.fits:
        said = " and ".join(disagreements.sentences[:2])
        return rigs._replace(withheld=f"{said}, and the images and points fit neither: {_REPAIR}")
    if best.survey.conventions == surveyed.conventions:
        return rigs
    turned = best.survey.conventions.axes is not surveyed.conventions.axes
    sentence = (disagreements.doubts if turned else disagreements.sentences)[0]
    remark = f"{sentence}: {best.survey.conventions}, for so the images and points fit"
    return rigs._replace(repairs=(remark, *rigs.repairs))


def _rigs_in_force(recording: Recording, surveyed: Survey) -> RigsInForce:
    """The rigs of a recording and when each is in force, by those calibrations that its images and points fit."""
    return with_fitting_rigs(recording, rigs_in_force(recording, surveyed))


def rigs_to_begin_with(recording: Recording, surveyed: Survey) -> tuple[RigsInForce, Changes] | None:
    """The settled rigs where no calibration changes, and what finds changes while frames are made; nothing is read.

    None where that is not enough: its calibrations contradict each other, or its topics have a read each. Raises
    RigError where there is no rig.
    """
    disagreements = contradictions(surveyed)
    if disagreements.sentences or disagreements.doubts or zero_lenses(surveyed) or not surveyed.interleaved:
        return None
    rigs, changes = rigs_unless_changed(recording, surveyed)
    return _with_pasts(rigs), changes


def rigs_through(recording: Recording, surveyed: Survey, rig_file: Path | None = None) -> RigsInForce:
    """The rigs that a recording is audited with, and when each is in force; that of a rig file always is.

    Where its calibrations contradict each other, some frames are measured to tell which is right. Raises RigError.
    """
    if rig_file is None:
        return _with_pasts(settled_rigs(recording, surveyed))
    given = _always_in_force(recording, surveyed, given_rig(rig_file, surveyed))
    return _with_pasts(RigsInForce((given,)))


def _with_pasts(rigs: RigsInForce) -> RigsInForce:
    """The rigs, and behind them the cameras of those that name no sensor, each alone with the LiDAR."""
    alone = (replace(one, rig=rig) for one in rigs.rigs for rig in pasts_of(one.rig))
    return rigs._replace(rigs=(*rigs.rigs, *alone))


def in_force(recording: Recording, surveyed: Survey, rig: Rig) -> RigInForce:
    """When one of a recording's own rigs is in force; any other rig always is."""
    return _in_force_by_any(recording, surveyed, rig.rig_id) or _always_in_force(recording, surveyed, rig)


def rigs_of(surveyed: Survey, rig_file: Path | None = None) -> tuple[Rig, ...]:
    """The rigs that a recording is audited with: its own, or the one of a rig file. Raises RigError."""
    return find_rigs(surveyed) if rig_file is None else (given_rig(rig_file, surveyed),)


def _in_force_by_any(recording: Recording, surveyed: Survey, rig_id: str) -> RigInForce | None:
    """When the rig of an id is in force, however the recording's calibrations are read; None where it never is."""
    lenses = ZeroLens if zero_lenses(surveyed) else (surveyed.conventions.zero_lens,)
    read = [read_by(surveyed, replace(surveyed.conventions, zero_lens=lens)) for lens in lenses]
    for candidate in (read_by(one, way) for one in read for way in contradictions(one).candidates):
        try:
            rigs = _rigs_in_force(recording, candidate)
        except RigError:
            continue
        for rig_in_force in _with_pasts(rigs).rigs:
            if rig_in_force.rig.rig_id == rig_id:
                return rig_in_force
    return None


def _always_in_force(recording: Recording, surveyed: Survey, rig: Rig) -> RigInForce:
    """A rig that no calibration of the recording ends, surveyed anew where its points have a unit of their own."""
    return RigInForce(rig, survey(recording, rig.units_m) if rig.units_m else surveyed)


def _negated(recording: Recording, survey: Survey, rig: Rig, pictures: float) -> str:
    """Why no verdict may be given where the images of a rig fit by `pictures`: they fit its cameras in reverse order.

    Empty where they do not, or fit as they are.
    """
    if not pictures < GEOMETRY_FIT.fits:
        return ""
    other = replace(survey, conventions=replace(survey.conventions, positions=Positions.NEGATED))
    topics = sorted(camera.topic for camera in rig.cameras)
    for turned in search_rigs(other).rigs:
        if turned.rig_id != rig.rig_id and sorted(camera.topic for camera in turned.cameras) == topics:
            fit = candidate_of(recording, other, turned).pictures
            if fit >= GEOMETRY_FIT.fits and fit - pictures >= GEOMETRY_FIT.better_by:
                return (
                    "the images fit the cameras in reverse order, and not as they are: the fourth columns of P have "
                    f"the wrong sign; {_REPAIR}"
                )
    return ""


def _other_way_up(recording: Recording, survey: Survey, rig: Rig, of_cameras: Mapping[int, float]) -> str:
    """Why no verdict may be given where the images of one camera fit no other's as they are, but another way up.

    `of_cameras` is how well those of each fit.
    """
    worst = min(of_cameras, key=lambda one: np.nan_to_num(of_cameras[one], nan=1.0), default=0)
    if not of_cameras.get(worst, 1.0) < GEOMETRY_FIT.fits:
        return ""
    frames = list(checked_frames(recording, survey, rig))
    for way, cut in _OTHER_WAYS_UP.items():
        fits = fits_of((_cut(frame, worst, cut) for frame in frames), rig)
        fit = better_quarter([one.of_cameras.get(worst, np.nan) for one in fits])
        if fit >= GEOMETRY_FIT.fits and fit - of_cameras[worst] >= GEOMETRY_FIT.better_by:
            camera = rig.camera(worst).topic if rig.n > 2 else "one of the two cameras"
            return (
                f"the images of {camera} fit the others' once they are {way}, and not as they are: put them right, or "
                "leave the camera out (--no-sensor)"
            )
    return ""


class RigDoubts(NamedTuple):
    """What of a rig does not fit its recording, one sentence a piece, and why no verdict may be given on it.

    `remarks` are what is not measured by it, and cast no doubt on it.
    """

    calibration_warnings: tuple[str, ...]
    withheld: str
    remarks: tuple[str, ...]


class FirstFrames(NamedTuple):
    """What some of a recording's first frames show: `measured` ones; in `compared` of them three sensors could be."""

    doubts: RigDoubts
    measured: int
    compared: int


def first_frames_of(recording: Recording, in_force: RigInForce, withheld: str) -> FirstFrames:
    """Measure some of the first frames of a recording with one rig; `withheld` is what is known already."""
    use_one_thread()
    matcher, check, rig = find_matcher("sgbm"), CalibrationMonitor(), in_force.rig
    stream = synchronise(recording, rig, in_force.survey, colour=True, stretches=in_force.stretches)
    frames = (frame for frame in stream if isinstance(frame, Frame))
    measured = compared = 0
    chosen = islice(frames, *(_SUCCESSIVE_FRAMES if rig.by_time else _CALIBRATION_FRAMES))
    for item in measure_stream(chosen, rig, matcher):
        assert not isinstance(item, SkippedFrame)
        measurement, evidence = item
        check.add(evidence, FaultFeatures().update(evidence))
        measured += 1
        by_errors = any(one and one.disparity_error(Statistic.GATED) is not None for one in measurement.counts)
        compared += by_errors or (not rig.cameras and bool(measurement.shares))
    return FirstFrames(doubts_of(recording, in_force, check, withheld, stream), measured, compared)


def doubts_of(
    recording: Recording, in_force: RigInForce, check: CalibrationMonitor, withheld: str, stream: FrameStream
) -> RigDoubts:
    """What a check of some of a stream's frames, or of all, finds to say against their rig.

    `withheld` is what cameras contradict in: it says nothing of a LiDAR alone.
    """
    if not in_force.rig.cameras:
        withheld = ""
    warnings = (*check.warnings(), *stream.remarks)
    withheld = withheld or stream.timing.withheld or _unfit(recording, in_force, check)
    return RigDoubts(warnings, withheld, check.remarks())


def _unfit(recording: Recording, in_force: RigInForce, check: CalibrationMonitor) -> str:
    """Why no verdict may be given where the images and points do not fit the rig; a change that made it is named."""
    survey, rig = in_force.survey, in_force.rig
    why = check.withheld() or _negated(recording, survey, rig, check.pictures)
    why = why or _other_way_up(recording, survey, rig, check.of_cameras)
    return f"{in_force.changes[0]}, and {why}" if why and in_force.changes else why


def _candidates(recording: Recording, surveyed: Survey, disagreements: Contradictions) -> list[Candidate]:
    """Each way to read the calibrations that gives a rig of its own, the standard's first. Raises RigError."""
    candidates: dict[str, Candidate] = {}
    for conventions in disagreements.candidates:
        survey = read_by(surveyed, conventions)
        try:
            rig = find_rigs(survey)[0]
            if rig.rig_id not in candidates:
                candidates[rig.rig_id] = candidate_of(recording, survey, rig)
        except RigError:
            if conventions == disagreements.candidates[-1] and not candidates:
                raise
    return list(candidates.values())


def _cut(frame: Frame, camera: int, cut: tuple[slice, slice]) -> Frame:
    """A frame with the rows and columns of a camera's image in another order."""
    images = dict(frame.images)
    if camera in images:
        images[camera] = replace(images[camera], pixels=np.ascontiguousarray(images[camera].pixels[cut]))
    return replace(frame, images=images)

"""What people are told of the thresholds that a recording was judged by, a sentence each."""

from collections.abc import Iterator

from auditor.model.calibration import Calibration
from auditor.model.rig_kind import Similarity
from auditor.pipeline.judge import Criteria, resolves_incidents
from auditor.store import StoredJudgement


def as_a_part(judgement: StoredJudgement, calibration: Calibration) -> Iterator[str]:
    """What of the calibrated rig was not there: whoever removes a sensor's topic must not get a clean recording."""
    if judgement.absent_sensors:
        absent = ("the LiDAR" if sensor == "LiDAR" else sensor for sensor in judgement.absent_sensors)
        yield f"judged as a part of {calibration.rig_kind}: without {', '.join(absent)}"


def unresolved(judgement: StoredJudgement, calibration: Calibration, criteria: Criteria) -> Iterator[str]:
    """What the clean frames were too few for."""
    if judgement.drives == 0:
        yield "judged by the prior alone: no clean drive of its rig kind was seen; calibrate on some"
    if not judgement.resolvable:
        yield f"r = {judgement.r} is not resolvable with the clean samples there are: judged as at r = 0"
    if not resolves_incidents(calibration, criteria):
        yield "too few clean frames for that incident rate: its limit is extrapolated"


def marked(judgement: StoredJudgement, calibration: Calibration) -> Iterator[str]:
    """The vehicle, LiDAR or machine that the calibration is of and the recording is not; or that it is of both."""
    marks = judgement.marks
    if marks.similarity is not Similarity.SAME:
        which = "a similar" if marks.similarity is Similarity.SIMILAR else "another"
        yield f"thresholds transferred from {which} rig kind: {calibration.rig_kind}"
    if marks.other_lidar:
        yield "another LiDAR than that of the thresholds, by its points in view"
    if marks.in_sample:
        yield "in sample: the calibration was made of it"
    if marks.measured_otherwise:
        yield f"the calibration's counts may differ: {marks.measured_otherwise}"

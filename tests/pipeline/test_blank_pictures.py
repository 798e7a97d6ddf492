"""Where nothing of a lone camera's picture was compared, the verdict says what the picture was."""

from dataclasses import replace
from decimal import Decimal

import numpy as np

from auditor.identification.incidents.series import FrameSeries, Portion
from auditor.model.calibration import RobustThresholds
from auditor.model.verdict import Verdict, VerdictKind
from auditor.pipeline.blank_pictures import with_pictures
from auditor.pipeline.judge import system_of
from tests.making.stores import make_rig

FRAMES = 6
STANDS = "the camera saw too little move"
THRESHOLDS = RobustThresholds("c" * 32, Decimal(0), 4.0, {}, {}, drives=0)


def portion(cameras: int) -> Portion:
    """Frames of which the second is black, the third white, and the last two are the fourth once more."""
    system = system_of(make_rig(cameras))
    shape = FRAMES, len(system.sensors)
    frozen = np.zeros(shape, dtype=np.bool_)
    frozen[4:, 1] = True
    level, saturated = np.full(FRAMES, 80.0), np.zeros(FRAMES)
    level[1], level[2], saturated[2] = 1.5, 254.0, 0.95
    series = FrameSeries(
        np.arange(FRAMES) * 10**8,
        np.zeros(FRAMES, dtype=np.int64),
        np.full((FRAMES, len(system.sensor_checks)), np.nan),
        np.ones(shape, dtype=np.bool_),
        frozen,
        brightness={("level", 1): level, ("saturated_share", 1): saturated},
    )
    return Portion(np.arange(FRAMES), series, system, THRESHOLDS)


def test_what_the_picture_was_is_said_of_frames_in_which_nothing_was_compared():
    verdicts = [Verdict(VerdictKind.NOT_AUDITABLE, "-", reason=STANDS)] * FRAMES
    pictures = ["is black", "is white", *["does not change"] * 3]
    reasons = [one.reason for one in with_pictures(verdicts, portion(1))]
    assert reasons == [STANDS, *(f"the camera's picture {picture}: nothing was compared" for picture in pictures)]


def test_a_picture_that_only_noise_changes_is_told_from_one_that_changes():
    still = portion(1)
    level, texture = np.array([80.0, 81, 81.01, 81.02, 81.01, 83]), np.array([0.4, 0.4, 0.401, 0.4, 0.45, 0.45])
    brightness = {("level", 1): level, ("textureless_share", 1): texture}
    frozen = np.zeros_like(still.series.frozen)
    verdicts = [Verdict(VerdictKind.NOT_AUDITABLE, "-", reason=STANDS)] * FRAMES
    told = with_pictures(verdicts, replace(still, series=replace(still.series, brightness=brightness, frozen=frozen)))
    same = "the camera's picture changes by no more than noise, as where it is frozen or the vehicle stands"
    assert [one.reason for one in told] == [STANDS, STANDS, *[f"{same}: nothing was compared"] * 2, STANDS, STANDS]


def test_what_was_compared_and_what_other_cameras_see_stays_as_it_was_said():
    verdicts = [Verdict(VerdictKind.NOT_AUDITABLE, "-", reason=STANDS)] * FRAMES
    compared = [replace(one, e="0") for one in verdicts]
    assert list(with_pictures(compared, portion(1))) == compared
    assert list(with_pictures(verdicts, portion(3))) == verdicts

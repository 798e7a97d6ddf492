"""Why nothing of a lone camera's picture was compared: it is black, or white, or does not change but for noise."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auditor.identification.incidents.series import Portion
from auditor.identification.paper import NOT_MEASURED
from auditor.model.arrays import Floats
from auditor.model.rig import LIDAR
from auditor.model.verdict import Verdict

_BLACK_LEVEL, _WHITE_SHARE = 4.0, 0.9
"""Mean grey level of 255 up to which a picture is called black, share of saturated pixels from which on it is called
white: no verdict depends on them."""

_SAME_LEVEL, _SAME_TEXTURE = 0.05, 0.005
"""By how much less than this the mean grey level, and the share without texture, of two pictures differ that are the
same but for a sensor's noise: no verdict depends on them."""


def with_pictures(verdicts: Sequence[Verdict], portion: Portion) -> Sequence[Verdict]:
    """The verdicts of one camera and a LiDAR, which say of the picture why nothing was compared, where it shows that.

    Those of other rigs stay as they are.
    """
    cameras = [sensor for sensor in portion.system.sensors if sensor != LIDAR]
    if not portion.system.by_time or len(cameras) != 1:
        return verdicts
    pictures = _in_words(portion, cameras[0])
    return [
        replace(verdict, reason=f"the camera's picture {picture}: nothing was compared")
        if picture and set(verdict.e) <= {NOT_MEASURED}
        else verdict
        for verdict, picture in zip(verdicts, pictures, strict=True)
    ]


def _in_words(portion: Portion, camera: int) -> list[str]:
    """What is wrong with each picture of a camera; empty where nothing is."""
    series = portion.series
    nothing = np.full(len(series.stamps_ns), np.nan)
    level = series.brightness.get(("level", camera), nothing)
    saturated = series.brightness.get(("saturated_share", camera), nothing)
    repeated = series.frozen[:, portion.system.sensors.index(camera)]
    frozen = repeated | np.append(repeated[1:], False)  # the first of pictures that are all the same is one of them
    textureless = series.brightness.get(("textureless_share", camera), nothing)
    same = (_steps(level) < _SAME_LEVEL) & (_steps(textureless) < _SAME_TEXTURE)
    conditions = {
        "is black": level <= _BLACK_LEVEL,
        "is white": saturated >= _WHITE_SHARE,
        "does not change": frozen,
        "changes by no more than noise, as where it is frozen or the vehicle stands": same,
    }
    words: list[str] = np.select([*conditions.values()], [*conditions], "").tolist()
    return words


def _steps(values: Floats) -> Floats:
    """(F,) by how much each value differs from the one before; NaN of the first."""
    return np.abs(np.diff(values, prepend=np.nan))

"""Why nothing of a lone camera's picture was compared: it is black, or white, or does not change."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from auditor.identification.incidents.series import Portion
from auditor.identification.paper import NOT_MEASURED
from auditor.model.rig import LIDAR
from auditor.model.verdict import Verdict

_BLACK_LEVEL, _WHITE_SHARE = 4.0, 0.9
"""Mean grey level of 255 up to which a picture is called black, share of saturated pixels from which on it is called
white: no verdict depends on them."""


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
    conditions = [level <= _BLACK_LEVEL, saturated >= _WHITE_SHARE, frozen]
    words: list[str] = np.select(conditions, ["is black", "is white", "does not change"], "").tolist()
    return words

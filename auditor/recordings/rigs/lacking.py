"""What a recording lacks to be audited, in words: why it has no rig at all, and why cameras are in none."""

from collections.abc import Iterator, Sequence

import numpy as np

from auditor.errors import RigError
from auditor.recordings.decoding import decoder_table
from auditor.recordings.decoding.sensor_types import UNREAD, is_other, other_content
from auditor.recordings.rigs.cameras import View
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.left_out import AllApart, Reason, TooFew
from auditor.recordings.rigs.ordering import MAX_SQUINT
from auditor.recordings.synchronisation.survey import Survey

_MOST_SAID = 12


def no_sensors(survey: Survey) -> RigError:
    """The error for a recording without pictures and points."""
    if survey.lost:
        return RigError(survey.lost[0], remedy="copy it again, end its recording first, or write smaller chunks")
    none = "there are no camera images and no points that can be read"
    missing = "; ".join([none, *_unreadable(survey), *_unknown(survey)])
    return RigError(f"no triple possible: {missing}", remedy="give a recording with two cameras, or with a LiDAR")


def no_rig(survey: Survey, left_out: Sequence[Reason]) -> RigError:
    """The error for a recording whose sensors form no rig; `left_out` says why not."""
    few = [why for why in left_out if isinstance(why, TooFew)]
    others = [why for why in left_out if why not in few]
    missing: list[object] = [*few] or ["there is no LiDAR"]
    missing += [*lacking_calibration(survey), *_unreadable(survey)]
    missing += [*survey.transform_problems[:_MOST_SAID], *others[:_MOST_SAID]]
    return RigError("no triple possible: " + "; ".join(map(str, missing)), remedy=what_to_record(left_out))


def what_to_record(left_out: Sequence[Reason]) -> str:
    """The remedy where sensors form no rig for these reasons."""
    few = [why for why in left_out if isinstance(why, TooFew)]
    if not few:
        return "record a camera info of each camera, and tf; or describe the rig in a rig file (--rig)"
    apart = [why for why in few if isinstance(why, AllApart)]
    pair = any(len(why.others) > 1 and why not in apart for why in few)
    degrees = round(np.degrees(MAX_SQUINT))
    three = f"record three cameras within {degrees} degrees of each other, at places that P or tf gives"
    remedy = f"{'add a third camera' if pair else three}, or a LiDAR whose place beside a camera tf gives"
    return f"{remedy}; or describe the rig in a rig file (--rig)" if apart or len(few) < len(left_out) else remedy


def lacking_calibration(survey: Survey) -> Iterator[str]:
    """That the recording's beginning has no calibration, and where one may be."""
    if not survey.camera_infos:
        yield "there is no camera info for any of the images"
    if survey.other_parts and not (survey.camera_infos and survey.transforms):
        yield f"another part of the drive may hold its calibration: give {survey.other_parts[0].name} too"


def told_together(reasons: Sequence[Reason], groups: Sequence[Sequence[View]], frames: FrameTree) -> list[Reason]:
    """The reasons why cameras are not compared; one for all cameras that are a group each, beside other cameras."""
    views = [view for group in groups for view in group]
    groups_of_one = {group[0].name: group[0] for group in groups if len(group) == 1}
    replaced = [why for why in reasons if isinstance(why, TooFew) and {*why.others} <= {*groups_of_one}]
    alone = [groups_of_one[name] for why in replaced for name in why.others]
    if not alone or len(views) == 1:
        return list(reasons)
    together = [why for why in reasons if why not in replaced]
    placed = [view for view in alone if _is_placed(view, views, frames)]
    if unplaced := [view.name for view in alone if view not in placed]:
        together.append(AllApart(unplaced, "neither P nor tf gives the positions of cameras"))
    if placed:
        others = "no two cameras look" if len(placed) == len(views) else "no other camera looks"
        together.append(AllApart([view.name for view in placed], f"{others} the same way at a like scale"))
    return together


def _is_placed(view: View, views: Sequence[View], frames: FrameTree) -> bool:
    """Whether tf says how a camera looks beside another one."""
    return any(frames.between(view.frame_id, other.frame_id) is not None for other in views if other is not view)


def _unknown(survey: Survey) -> Iterator[str]:
    """The topics of types that nobody knows, of which one may be a sensor's."""
    unknown = [one for one in survey.topics if one.schema not in decoder_table() and not is_other(one.schema)]
    names = [f"{one.name} ({one.schema or 'no type'}, {one.encoding})" for one in unknown if one.schema not in UNREAD]
    if names:
        yield f"types that are not known: {', '.join(names[:6])}; convert what is a sensor's to sensor_msgs"


def _unreadable(survey: Survey) -> Iterator[str]:
    """What is there and cannot be read, as far as the recording's beginning shows."""
    for sensor in [one for one in survey.unreadable if not other_content(one.reason)][:_MOST_SAID]:
        yield f"{sensor.topic.name} ({sensor.kind}): {sensor.reason}; {sensor.remedy}"

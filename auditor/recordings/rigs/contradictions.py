"""Where the calibrations of a recording contradict each other or its pictures, and all ways to read them."""

from typing import NamedTuple

from auditor.recordings.rigs.calibrations import contradicts_size
from auditor.recordings.rigs.cameras import View, find_views
from auditor.recordings.rigs.conventions import Conventions, Positions, Scale
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.ordering import contradiction, grouped
from auditor.recordings.synchronisation.survey import Survey


class Contradictions(NamedTuple):
    """What a recording says twice of its calibration, and differently, a sentence each; and all ways to read it.

    The first candidate is the standard's.
    """

    sentences: tuple[str, ...]
    candidates: tuple[Conventions, ...]


def contradictions(survey: Survey) -> Contradictions:
    """Where the calibrations of a recording contradict each other or its pictures."""
    views, frames = find_views(survey, []), FrameTree(survey.transforms)
    sizes = [_of_size(view, survey) for view in views]
    places = [contradiction(group, frames) for group in grouped(views, frames)]
    sentences = tuple(filter(None, (*sizes, *places)))
    candidates = tuple(
        Conventions(positions, scale)
        for positions in ((Positions.P, Positions.TF) if any(places) else (Positions.P,))
        for scale in (Scale if any(sizes) else (Scale.DECLARED,))
    )
    return Contradictions(sentences, candidates)


def _of_size(view: View, survey: Survey) -> str:
    info, size_px = survey.camera_infos[view.info_topic], view.image.size_px
    if not contradicts_size(info, size_px):
        return ""
    declared = f"{info.width_px} x {info.height_px} px" + (f", binned by {max(info.binning)}" * (max(info.binning) > 1))
    return f"{view.info_topic} declares {declared}, and the pictures have {size_px[0]} x {size_px[1]} px"

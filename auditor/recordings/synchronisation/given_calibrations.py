"""Calibrations that stand beside a recording's messages, put where its own camera infos and transforms are."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Protocol

from auditor.errors import DecodingError
from auditor.recordings.decoding.calibration_texts import Calibrations, CameraCalibration, calibrations_of
from auditor.recordings.decoding.interface import CameraInfo, Transform
from auditor.recordings.recording import CarriesCalibrations, Recording, Topic

_MOST_CHARACTERS = 2**17
"""Of all texts of a recording: a parser of YAML takes 12 us for each."""


class Pictures(Protocol):
    """A topic of pictures; see survey.ImageTopic."""

    @property
    def topic(self) -> Topic:
        """The topic."""

    @property
    def frame_id(self) -> str:
        """The frame of its first picture."""


def completed_by_texts(
    recording: Recording,
    images: Sequence[Pictures],
    infos: dict[str, CameraInfo],
    transforms: tuple[Transform, ...],
) -> tuple[dict[str, CameraInfo], tuple[Transform, ...], list[str]]:
    """Camera infos and transforms with what texts beside the messages add to them, and a sentence on each text."""
    texts = recording.calibrations() if isinstance(recording, CarriesCalibrations) else {}
    left, notes = _MOST_CHARACTERS, []
    for name, text in sorted(texts.items()):
        if name.lower().endswith(".json"):
            continue  # the metadata of a LiDAR's packets
        left -= len(text)
        if left < 0:
            break
        with suppress(DecodingError):  # attachments may be anything
            more, places = completed(calibrations_of(text), images, infos, transforms, replacing=False)
            added = len(more) - len(infos), len(places) - len(transforms)
            if any(added):
                notes.append(f"{name}: {added[0]} cameras and {added[1]} frames are as this text in the recording says")
            infos, transforms = more, places
    return infos, transforms, notes


def completed(
    found: Calibrations,
    images: Iterable[Pictures],
    infos: Mapping[str, CameraInfo],
    transforms: Sequence[Transform],
    *,
    replacing: bool,
) -> tuple[dict[str, CameraInfo], tuple[Transform, ...]]:
    """Camera infos by topic, and transforms; those of the recording stay, or with `replacing` give way."""
    known, frames = dict(infos), {}
    for image in images:
        for one in found.cameras:
            if _is_of(image.topic.name, one):
                frames[one.info.header.frame_id] = image.frame_id or one.info.header.frame_id
                info = replace(one.info, header=replace(one.info.header, frame_id=frames[one.info.header.frame_id]))
                beside, below = (
                    f"{name}/camera_info" for name in (image.topic.name.rpartition("/")[0], image.topic.name)
                )
                if replacing and beside in known:
                    known[beside] = info
                elif beside not in known:
                    known.setdefault(below, info)
    named = tuple(
        replace(one, parent=frames.get(one.parent, one.parent), child=frames.get(one.child, one.child))
        for one in found.transforms
    )
    first, then = (named, transforms) if replacing else (transforms, named)
    placed = {one.child for one in first}
    return known, (*first, *(one for one in then if one.child not in placed))


def _is_of(topic: str, one: CameraCalibration) -> bool:
    """Whether a calibration is that of a topic's camera: by the topic, or by a part of it that is the camera's name."""
    return topic == one.camera or one.camera.strip("/") in topic.strip("/").split("/")

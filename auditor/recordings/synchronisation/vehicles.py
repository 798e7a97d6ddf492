"""Several vehicles in one recording whose coordinate frames have the same names: each has a namespace of topics.

Where each namespace has tf topics of its own, a frame is called by its namespace and its name, as tf_prefix has it.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import replace

from auditor.recordings.decoding import CameraInfo, Transform
from auditor.recordings.recording import Topic

_FEWEST_FRAMES = 2  # in common: the pictures of two cameras that stand beside each other may be of one frame


def sharing_frames(frames: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """The namespaces whose sensors have the same names and frames, as of several vehicles; `frames` are by topic."""
    owners: dict[tuple[str, str], set[str]] = defaultdict(set)
    for topic, frame in frames:
        if frame and (rest := topic.removeprefix(f"/{_namespace(topic)}/")) != topic:
            owners[rest, frame].add(_namespace(topic))
    shared: dict[str, set[str]] = defaultdict(set)
    for (_, frame), spaces in owners.items():
        for space in spaces if len(spaces) > 1 else ():
            shared[space].add(frame)
    return tuple(sorted(space for space, names in shared.items() if len(names) >= _FEWEST_FRAMES))


def have_tf_each(spaces: Iterable[str], topics: Iterable[Topic]) -> bool:
    """True where each of some namespaces has tf topics of its own."""
    return {_namespace(one.name) for one in topics if one.name.endswith(("/tf", "/tf_static"))}.issuperset(spaces)


def space_of(topic: str, spaces: Collection[str]) -> str:
    """The one of some namespaces that a topic is in; empty where it is in none."""
    return _namespace(topic) if _namespace(topic) in spaces else ""


def frame_of(frame_id: str, topic: str, spaces: Collection[str]) -> str:
    """The frame of a message: with the namespace of its topic, where that is one of `spaces`."""
    space = space_of(topic, spaces)
    return f"{space}/{frame_id}" if frame_id and space else frame_id


def info_of(info: CameraInfo, topic: str, spaces: Collection[str]) -> CameraInfo:
    """A camera info with the frame that `frame_of` gives."""
    return replace(info, header=replace(info.header, frame_id=frame_of(info.header.frame_id, topic, spaces)))


def transform_of(transform: Transform, topic: str, spaces: Collection[str]) -> Transform:
    """A transform with the frames that `frame_of` gives."""
    parent, child = (frame_of(one, topic, spaces) for one in (transform.parent, transform.child))
    return replace(transform, parent=parent, child=child)


def _namespace(topic: str) -> str:
    """The first part of a topic's name; empty where it has one alone."""
    return topic.removeprefix("/").rpartition("/")[0].partition("/")[0]

"""What there is to say before a recording is measured with PSMNet: what it will cost, and what looks wrong."""

from collections.abc import Iterator, Sequence

from auditor.evidence.matchers.psmnet.checking import first_frames_warnings
from auditor.evidence.matchers.psmnet.cost import frame_cost
from auditor.evidence.matchers.psmnet.matcher import PsmnetMatcher
from auditor.evidence.rectifying import rectification
from auditor.frames import Frame
from auditor.rig import Rig

_HOUR_S, _MINUTE_S = 3600.0, 60.0


def foretell(matcher: PsmnetMatcher, rig: Rig, first: Sequence[Frame], count: int) -> Iterator[str]:
    """Sentences for people, from the first frames of a recording of `count` frames; the cost comes first."""
    seen = rectification(rig)
    camera = seen.rig.cameras[-1]
    # A camera is another image in each pair that has a view of its own.
    images = 2 * len(rig.pairs) if seen.pairs else len({camera for pair in rig.pairs for camera in pair})
    cost = frame_cost(matcher, (camera.height_px, camera.width_px))
    frame_s = cost.frame_s(images, len(rig.pairs))
    where = cost.device if cost.device != "cpu" else f"cpu ({cost.threads} threads)"
    yield f"psmnet on {where}: about {_span(frame_s)} a frame, {_span(frame_s * count)} for {count} frames"
    if seen.pairs:
        own = seen.pairs[1, rig.n]
        yield from first_frames_warnings(matcher, own.seen.rig, [own.frame(frame) for frame in first], own.sights)
    else:
        yield from first_frames_warnings(matcher, seen.rig, [seen.frame(frame) for frame in first])


def _span(seconds: float) -> str:
    if seconds >= _HOUR_S:
        return f"{seconds / _HOUR_S:.1f} h"
    if seconds >= 2 * _MINUTE_S:
        return f"{seconds / _MINUTE_S:.0f} min"
    return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"

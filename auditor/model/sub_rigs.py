"""Rigs that are a part of a rig kind: those that lack its LiDAR or some of its cameras."""

from collections.abc import Iterator
from dataclasses import dataclass

from auditor.model.rig import LIDAR, Rig
from auditor.model.rig_kind import TOLERANCES, RigKind, Similarity, Tolerance


@dataclass(frozen=True)
class SubRig:
    """A rig as a part of the rig kind `whole`: by its sensors, ascending, their numbers there.

    `similarity` is how alike the rig is to the same sensors of the whole.
    """

    whole: RigKind
    sensors: tuple[int, ...]
    similarity: Similarity = Similarity.SAME

    @property
    def absent(self) -> tuple[str, ...]:
        """What of the whole it lacks, in words; a camera's place is that to the left of S_1."""
        lidar = ("LiDAR",) if self.whole.lidar and LIDAR not in self.sensors else ()
        return (
            *lidar,
            *(_in_words(self.whole, camera) for camera in _cameras(self.whole) if camera not in self.sensors),
        )


def sub_rig(whole: RigKind, rig: Rig) -> SubRig | None:
    """The rig as a part of a rig kind with more sensors; None where it is none.

    Cameras are the same where sizes, focal lengths and all baselines agree as those of one rig kind do; only where none
    are, as those of similar kinds do. Where several choices of cameras agree, that with the nearest baselines is taken,
    of these the first.
    """
    if (rig.lidar and not whole.lidar) or len(rig.sensors) >= len(_cameras(whole)) + whole.lidar:
        return None
    for similarity, tolerance in TOLERANCES.items():
        choices = ((_apart_m(whole, rig, cameras), cameras) for cameras in _choices(whole, rig, tolerance, ()))
        if best := min(choices, default=None):
            return SubRig(whole, ((LIDAR,) if rig.lidar else ()) + best[1], similarity)
    return None


def _choices(whole: RigKind, rig: Rig, tolerance: Tolerance, chosen: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Every choice of cameras of the whole that agrees with the rig's and begins so, in ascending order."""
    if len(chosen) == rig.n:
        yield chosen
        return
    for number in range(chosen[-1] + 1 if chosen else 1, len(_cameras(whole)) + 1):
        if _agrees(whole, rig, tolerance, (*chosen, number)):
            yield from _choices(whole, rig, tolerance, (*chosen, number))


def _agrees(whole: RigKind, rig: Rig, tolerance: Tolerance, chosen: tuple[int, ...]) -> bool:
    """Whether the last camera chosen agrees with the rig's camera of that place, and with those before it."""
    number = chosen[-1]
    own = rig.camera(len(chosen))
    return (
        tolerance.sizes(whole.sizes_px[number - 1], (own.width_px, own.height_px))
        and tolerance.focals(whole.focals_px[number - 1], own.focal_px)
        and all(
            tolerance.baselines(baseline_m(whole, other, number), rig.baseline_m(place, own.number))
            for place, other in enumerate(chosen[:-1], start=1)
        )
    )


def _apart_m(whole: RigKind, rig: Rig, cameras: tuple[int, ...]) -> float:
    """By how much all baselines differ together."""
    pairs = [(i, k) for k in range(2, rig.n + 1) for i in range(1, k)]
    return sum(abs(baseline_m(whole, cameras[i - 1], cameras[k - 1]) - rig.baseline_m(i, k)) for i, k in pairs)


def baseline_m(kind: RigKind, i: int, k: int) -> float:
    """Distance in metres between cameras i < k of a rig kind: on one line it is the sum of those between."""
    n = len(_cameras(kind))
    if k == i + 1 or len(kind.baselines_m) == n - 1:
        return sum(kind.baselines_m[i - 1 : k - 1])
    apart = [(a, b) for a in range(1, n + 1) for b in range(a + 2, n + 1)]
    return kind.baselines_m[n - 1 + apart.index((i, k))]


def _cameras(kind: RigKind) -> range:
    return range(1, len(kind.sizes_px) + 1)


def _in_words(kind: RigKind, camera: int) -> str:
    width, height = kind.sizes_px[camera - 1]
    left_m = baseline_m(kind, 1, camera) if camera > 1 else 0.0
    return f"S_{camera} ({width} x {height} at {left_m:+.2f} m)"

"""What a rig can and cannot identify, in sentences."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from auditor.model.rig import Rig

Pair = tuple[int, int]

_BEHIND = 1.5
"""What a pair tells apart that checks the LiDAR: a surface and one half as far again."""

_HELD_LIGHT = (
    "not told apart: weak light that is held on one camera for seconds, and drops or glare on its lens (suspect), "
    "unless it has one colour and another camera has colours as well (docs/method.md)"
)
"""Rigs do not say which cameras have colours."""

_BY_TIME = (
    "one camera and a LiDAR: the LiDAR is checked by the camera's own past while the vehicle moves, and S_0 is named",
    "not looked at: light on the camera, which no other camera sees; points that are removed from the LiDAR; anything "
    "while the vehicle stands; what lies where it drives to (the focus of expansion), has no texture, or is farther "
    "away than parallax tells",
    "not told apart: a bogus wall and what moves along with the vehicle as far as the camera shows; an attack on the "
    "camera that moves as a scene at another range would",
)


def short_pairs(rig: "Rig") -> list[Pair]:
    """The matched pairs of cameras whose disparities say too little about depth to check the LiDAR."""
    wide = _pairs(rig)
    return [pair for pair in rig.pairs if rig.lidar and pair not in wide]


def capabilities(rig: "Rig") -> list[str]:
    """What can be identified at most, which cameras check the LiDAR, and what is missing for more."""
    if rig.by_time:
        return list(_BY_TIME)
    N, triples, most = len(rig.sensors), len(rig.triples), rig.max_attacked
    compared = f"{triples} triple{'s' if triples != 1 else ''} of sensors can be compared"
    if most == 0:
        lines = [f"{compared}: an attack is detected, but with three sensors its sensor cannot be identified"]
    else:
        lines = [
            f"{compared}: up to {most} attacked sensor{'s' if most != 1 else ''} at once can be identified "
            f"(N - 3 of N = {N} sensors)"
        ]
    lines += _of_lidar(rig) if rig.lidar else _of_cameras()
    return [*lines, _HELD_LIGHT] if most else lines


def _of_lidar(rig: "Rig") -> list[str]:
    wide, short = _pairs(rig), short_pairs(rig)
    lines = []
    if not wide:
        lines.append(
            "no pair of cameras is wide enough to check the LiDAR: only an upright part of its view without most "
            "points, or many isolated points, are noticed"
        )
    elif len(wide) == 1 and rig.max_attacked:
        lines.append(
            f"only {_listed(wide)} can check the LiDAR: while one of these cameras is attacked, the LiDAR's points "
            "are not checked"
        )
    else:
        lines.append(f"the LiDAR is checked by {_listed(wide)}")
    lines += _reaches(rig, wide) if wide else []
    if short:
        lines.append(f"too close together to check it (less than 9 px of disparity at 10 m): {_listed(short)}")
    return lines


def _reaches(rig: "Rig", wide: list[Pair]) -> list[str]:
    """How far away invented and removed surfaces are noticed, by the widest pair."""
    from auditor.measurement.parameters import DISPARITY_ERROR  # noqa: PLC0415 - OpenCV is heavy
    from auditor.measurement.point_parameters import FALSE_RANGES, LOST_RETURNS  # noqa: PLC0415

    # f b / z - f b / (1.5 z) is what Eq. 2 asks for.
    reach_m = max(_disparity_at_1_m(rig, pair) for pair in wide) * (1 - 1 / _BEHIND) / DISPARITY_ERROR.absolute_px
    return [
        f"a bogus wall is told from textured surfaces {_BEHIND:g} times as far away, up to {reach_m:.0f} m at most",
        f"vanished objects and sectors are noticed up to {LOST_RETURNS.farthest_m:g} m, below the LiDAR's horizon, "
        "where a whole car or more is gone",
        f"invented cars of some dozens of points are noticed from {FALSE_RANGES.nearest_m:g} m on, where cameras see "
        "something else",
        "not noticed: walls in front of the sky, or farther away; a few hundred points here and there; mostly a "
        "LiDAR and a camera that are forged to agree (docs/attacks.md)",
    ]


def _disparity_at_1_m(rig: "Rig", pair: Pair) -> float:
    """The disparity in px of what is 1 m away."""
    cameras = rig.cameras if rig.shares_view else [rig.camera(number) for number in pair]
    return min(camera.focal_px for camera in cameras) * rig.baseline_m(*pair)


def _of_cameras() -> list[str]:
    return [
        "without a LiDAR cameras are compared with each other only: the robust method does not notice a camera whose "
        "image is shifted along its rows"
    ]


def _pairs(rig: "Rig") -> list[Pair]:
    from auditor.model.checks import conflict_pairs  # noqa: PLC0415 - NumPy is heavy

    return list(conflict_pairs(rig))


def _listed(pairs: list[Pair]) -> str:
    return ", ".join(f"S_{i} and S_{k}" for i, k in pairs)

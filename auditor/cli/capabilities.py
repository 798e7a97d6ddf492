"""What a rig identifies, and what passes unseen, in the words of `auditor inspect`."""

from auditor.measurement.checks.free_space_conflict import NUMBERS as FREE_SPACE
from auditor.measurement.parameters import DISPARITY_ERROR
from auditor.measurement.point_parameters import FALSE_RANGES, LOST_RETURNS
from auditor.model.checks import Pair, conflict_pairs
from auditor.model.rig import Rig

_BEHIND = 1.5
"""What a pair tells apart that checks the LiDAR: a surface and one half as far again."""

_HELD_LIGHT = (
    "not told apart: weak light that is held on one camera for seconds, and drops or glare on its lens (suspect), "
    "unless it has one colour and another camera has colours as well (docs/method.md)"
)
"""Rigs do not say which cameras have colours."""

_BY_TIME = (
    "one camera and a LiDAR: each is checked by the other and by the camera's own past while the vehicle moves: points "
    "that move as no picture does name S_0, light that stays in the picture while the scene moves names S_1",
    "not looked at: light where the LiDAR has no points, as in the sky; points that are removed from the LiDAR; what "
    "happens while the vehicle stands; what lies where it drives to (the focus of expansion), has no texture, or is "
    "farther away than parallax tells",
    "not told apart: a bogus wall and what moves along with the vehicle as far as the camera shows; an attack on the "
    "camera that moves as a scene at another range would",
)

_OWN_SCANS = (
    f"checked by its own last scan: what stands up where its beams passed a moment ago, in {FREE_SPACE.farthest_m:g} m "
    "and with nothing near from which it can have come, names it; also while the vehicle stands"
)
_NOT_BY_SCANS = (
    f"points that are removed or moved; what is less than {FREE_SPACE.clearly_m:g} m above the ground; scans more than "
    f"{FREE_SPACE.most_s:g} s apart"
)
_NOT_BY_OWN_SCANS = f"not looked at: what is there from the first frame on; {_NOT_BY_SCANS}"
_BY_SCANS = f"a LiDAR alone is {_OWN_SCANS}", _NOT_BY_OWN_SCANS
_BY_OTHER_SCANS = (
    "several LiDARs: each is compared with the others where both look: what stands by its points where another one's "
    "beams went on behind, also what is there from the first frame on",
    "two that contradict each other do not say which is attacked: an incident names neither, unless what one shows "
    "came from nowhere by its own last scan, or a third LiDAR agrees with the other",
    f"each is {_OWN_SCANS}",
    "not looked at: what only one of them sees, as behind things or beyond the other's beams; what is near something "
    f"that the other sees, or moves; posts, wires and boards; points that scatter; {_NOT_BY_SCANS}",
)
_OF_THREE = (
    "which sensor it is on is told where the LiDAR's own scans show it, else by each camera's own past, as said below"
)
_OF_THREE_CAMERAS = "light on one of the cameras is told by the other two where these agree; of two at once none is"


def short_pairs(rig: Rig) -> list[Pair]:
    """The matched pairs of cameras whose disparities say too little about depth to check the LiDAR."""
    return [pair for pair in rig.pairs if rig.lidar and pair not in conflict_pairs(rig)]


def capabilities(rig: Rig) -> list[str]:
    """What can be identified at most, which cameras check the LiDAR, and what is missing for more."""
    if rig.by_time:
        return list(_BY_TIME if rig.cameras else _BY_OTHER_SCANS if rig.others else _BY_SCANS)
    N, triples, most = len(rig.sensors), len(rig.triples), rig.max_attacked
    compared = f"{triples} triple{'s' if triples != 1 else ''} of sensors can be compared"
    if most == 0:
        told = _OF_THREE if rig.lidar else _OF_THREE_CAMERAS
        lines = [f"{compared}: an attack is detected; {told}"]
    else:
        lines = [
            f"{compared}: up to {most} attacked sensor{'s' if most != 1 else ''} at once can be identified "
            f"(N - 3 of N = {N} sensors)"
        ]
    lines += _of_lidar(rig) if rig.lidar else _of_cameras()
    return [*lines, _HELD_LIGHT] if most else lines


def _of_lidar(rig: Rig) -> list[str]:
    wide, short = list(conflict_pairs(rig)), short_pairs(rig)
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
    lines.append(f"where no camera looks the LiDAR is {_OWN_SCANS}; {_NOT_BY_OWN_SCANS}")
    if short:
        lines.append(f"too close together to check it (less than 9 px of disparity at 10 m): {_listed(short)}")
    return lines


def _reaches(rig: Rig, wide: list[Pair]) -> list[str]:
    """How far away invented and removed surfaces are noticed, by the widest pair."""
    # f b / z - f b / (1.5 z) is what Eq. 2 asks for.
    reach_m = max(_disparity_at_1_m(rig, pair) for pair in wide) * (1 - 1 / _BEHIND) / DISPARITY_ERROR.absolute_px
    told = [f"a bogus wall is told from textured surfaces {_BEHIND:g} times as far away, up to {reach_m:.0f} m at most"]
    gone = "objects that are removed, as one pair of cameras alone does not tell; "
    if len(wide) > 1:
        gone = ""
        told += [
            f"vanished objects and sectors are noticed up to {LOST_RETURNS.farthest_m:g} m, below the LiDAR's horizon, "
            "where a whole car or more is gone",
            f"invented cars of some dozens of points are noticed from {FALSE_RANGES.nearest_m:g} m on, where cameras "
            "see something else",
        ]
    return [
        *told,
        f"not noticed: {gone}walls in front of the sky, or farther away; a few hundred points here and there; mostly a "
        "LiDAR and a camera that are forged to agree (docs/attacks.md)",
    ]


def _disparity_at_1_m(rig: Rig, pair: Pair) -> float:
    """The disparity in px of what is 1 m away."""
    cameras = rig.cameras if rig.shares_view else [rig.camera(number) for number in pair]
    return min(camera.focal_px for camera in cameras) * rig.baseline_m(*pair)


def _of_cameras() -> list[str]:
    return [
        "without a LiDAR cameras are compared with each other only: the robust method does not notice a camera whose "
        "image is shifted along its rows"
    ]


def _listed(pairs: list[Pair]) -> str:
    return ", ".join(f"S_{i} and S_{k}" for i, k in pairs)

"""What a rig can and cannot identify, in sentences."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from auditor.model.rig import Rig

Pair = tuple[int, int]


def short_pairs(rig: "Rig") -> list[Pair]:
    """The matched pairs of cameras whose disparities say too little about depth to check the LiDAR."""
    wide = _pairs(rig)
    return [pair for pair in rig.pairs if rig.lidar and pair not in wide]


def capabilities(rig: "Rig") -> list[str]:
    """What can be identified at most, which cameras check the LiDAR, and what is missing for more."""
    N, triples, most = len(rig.sensors), len(rig.triples), rig.max_attacked
    compared = f"{triples} triple{'s' if triples != 1 else ''} of sensors can be compared"
    if most == 0:
        lines = [f"{compared}: an attack is detected, but with three sensors its sensor cannot be identified"]
    else:
        lines = [
            f"{compared}: up to {most} attacked sensor{'s' if most != 1 else ''} at once can be identified "
            f"(N - 3 of N = {N} sensors)"
        ]
    return [*lines, *(_of_lidar(rig) if rig.lidar else _of_cameras())]


def _of_lidar(rig: "Rig") -> list[str]:
    wide, short = _pairs(rig), short_pairs(rig)
    lines = []
    if not wide:
        lines.append("no pair of cameras is wide enough to check the LiDAR: only missing points are noticed")
    elif len(wide) == 1 and rig.max_attacked:
        lines.append(
            f"only {_listed(wide)} can check the LiDAR: while one of these cameras is attacked, the LiDAR's points "
            "are not checked"
        )
    else:
        lines.append(f"the LiDAR is checked by {_listed(wide)}")
    if short:
        lines.append(f"too close together to check it (less than 9 px of disparity at 10 m): {_listed(short)}")
    return lines


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

"""What a rig can and cannot identify, in sentences."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from auditor.model.rig import Rig

Pair = tuple[int, int]


def short_pairs(rig: "Rig") -> list[Pair]:
    """The matched pairs of cameras whose disparities say too little about depth to deny the LiDAR."""
    from auditor.model.checks import Check, rig_pair_checks  # noqa: PLC0415 - NumPy is heavy

    pair_checks = rig_pair_checks(rig)
    denying = _pairs(rig)
    return [
        (e.i, e.k)
        for e in pair_checks
        if rig.lidar and e.check is Check.PHOTOMETRIC_INCONSISTENCY and (e.i, e.k) not in denying
    ]


def capabilities(rig: "Rig") -> list[str]:
    """What can be identified at most, who can deny the LiDAR, and what is missing for more."""
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
    denying, short = _pairs(rig), short_pairs(rig)
    lines = []
    if not denying:
        lines.append("no pair of cameras is wide enough to deny the LiDAR: of it only missing points are noticed")
    elif len(denying) == 1 and rig.max_attacked:
        lines.append(
            f"only {_told(denying)} can deny the LiDAR: while one of these cameras is attacked, the LiDAR's points are "
            "not questioned"
        )
    else:
        lines.append(f"the LiDAR can be denied by {_told(denying)}")
    if short:
        lines.append(f"too close together to deny it (less than 9 px of disparity at 10 m): {_told(short)}")
    return lines


def _of_cameras() -> list[str]:
    return [
        "without a LiDAR cameras are identified by what they do not see alike only: a camera whose picture is shifted "
        "along its rows is not noticed by the robust method"
    ]


def _pairs(rig: "Rig") -> list[Pair]:
    from auditor.model.checks import Check, rig_pair_checks  # noqa: PLC0415 - NumPy is heavy

    return [(e.i, e.k) for e in rig_pair_checks(rig) if e.check is Check.LIDAR_CONFLICT]


def _told(pairs: list[Pair]) -> str:
    return ", ".join(f"S_{i} and S_{k}" for i, k in pairs)

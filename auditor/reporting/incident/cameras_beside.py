"""What other rigs of a recording say in the seconds of an incident that names no sensor.

A LiDAR may be in a rig with cameras and in one with other LiDARs. Their incidents are apart, each of its own rig. Where
two LiDARs contradict each other, the verdicts of the rig with cameras say which of them it is, if its cameras look at
the place. Where a LiDAR and two cameras do, the past of each camera says it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.model.optics.common_view import recorded_pixels
from auditor.model.optics.geometry import Matrix, invert
from auditor.model.rig import LIDAR, Camera, Rig
from auditor.reporting.incident.contradictions import Contradiction
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store

_RIGS = "SELECT measurement_id, rig_id FROM stored_measurements WHERE recording_id = '{}' ORDER BY measured_at"

_VERDICTS = """
    SELECT
        count(*) FILTER (kind <> 'not_auditable') AS audited,
        count(*) FILTER (list_contains(attacked, {LIDAR})) AS named
    FROM verdicts
    WHERE measurement_id = '{measurement}' AND stamp_ns BETWEEN {from_ns} AND {to_ns}
"""


_NAMED = """
    SELECT rig_id, attacked[1] AS sensor, count(*) AS frames
    FROM verdicts
    WHERE recording_id = '{recording}' AND measurement_id <> '{measurement}' AND len(attacked) = 1
        AND stamp_ns BETWEEN {from_ns} AND {to_ns}
    GROUP BY ALL ORDER BY frames DESC, rig_id
"""


@dataclass(frozen=True)
class NamedByPast:
    """A sensor that a camera's past names in so many frames."""

    camera: str
    sensor: str
    frames: int


@dataclass(frozen=True, eq=False)
class CameraRig:
    """A measurement of a recording by a rig with cameras, whose LiDAR is `sensor` of the rig of LiDARs."""

    measurement_id: str
    rig: Rig
    sensor: int


@dataclass(frozen=True)
class Beside:
    """What the cameras of a rig say of the LiDAR `sensor`: in so many frames that were audited they named it.

    `cameras` are the names of those whose pictures show the place that is contradicted.
    """

    sensor: int
    audited: int
    named: int
    cameras: tuple[str, ...]


def camera_rigs(store: Store, recording_id: str, rig: Rig) -> list[CameraRig]:
    """The rigs with cameras of a recording that have a LiDAR of a rig of several; of each LiDAR's the latest."""
    if not rig.others:
        return []
    numbers = {rig.topic(sensor): sensor for sensor in rig.sensors}
    rigs = {}
    for row in rows_of(run_sql(store, _RIGS.format(recording_id))):
        other = store.rig(row["rig_id"])
        if other.cameras and other.topic(LIDAR) in numbers:
            camera_rig = CameraRig(row["measurement_id"], other, numbers[other.topic(LIDAR)])
            rigs[row["rig_id"]] = camera_rig
    return list(rigs.values())


def beside(
    store: Store, rig: Rig, others: Iterable[CameraRig], told: Sequence[Contradiction], from_ns: int, to_ns: int
) -> tuple[Beside, ...]:
    """What each of some rigs with cameras says in these seconds of its LiDAR, where that is one of the contested."""
    return tuple(
        Beside(one.sensor, **_said(store, one, from_ns, to_ns), cameras=_showing(rig, one, contested))
        for contested in [one for one in told if one.others][:1]
        for one in others
        if one.sensor in (contested.sensor, *contested.others)
    )


def named_by_pasts(
    store: Store, recording_id: str, measurement_id: str, from_ns: int, to_ns: int
) -> tuple[NamedByPast, ...]:
    """What cameras that are compared with their own past name in these seconds, by another measurement than this."""
    asked = _NAMED.format(recording=recording_id, measurement=measurement_id, from_ns=from_ns, to_ns=to_ns)
    rows = [(store.rig(row["rig_id"]), row["sensor"], row["frames"]) for row in rows_of(run_sql(store, asked))]
    return tuple(NamedByPast(rig.name(1), rig.name(sensor), frames) for rig, sensor, frames in rows if rig.n == 1)


def _said(store: Store, camera_rig: CameraRig, from_ns: int, to_ns: int) -> dict[str, int]:
    asked = _VERDICTS.format(LIDAR=LIDAR, measurement=camera_rig.measurement_id, from_ns=from_ns, to_ns=to_ns)
    return dict(*rows_of(run_sql(store, asked)))


def _showing(rig: Rig, camera_rig: CameraRig, told: Contradiction) -> tuple[str, ...]:
    """The names of the cameras whose pictures show the middle of what is contradicted."""
    assert camera_rig.rig.lidar is not None
    place_m = np.median(told.place_m, axis=0) + rig.lidars[told.sensor].rig_SE3_lidar[:3, 3]
    cameras_SE3_rig = camera_rig.rig.lidar.rig_SE3_lidar @ invert(rig.lidars[camera_rig.sensor].rig_SE3_lidar)
    place_m = (cameras_SE3_rig @ np.append(place_m, 1))[:3]
    return tuple(camera.name for camera in camera_rig.rig.cameras if _shows(camera, place_m))


def _shows(camera: Camera, place_m: Matrix) -> bool:
    x, y, ahead = camera.rotation @ (place_m - camera.centre_m)
    if ahead <= 0:
        return False
    u, v = recorded_pixels(camera, camera.rotation, np.array([x / ahead]), np.array([y / ahead]))
    return bool((u >= 0) & (u < camera.width_px) & (v >= 0) & (v < camera.height_px))

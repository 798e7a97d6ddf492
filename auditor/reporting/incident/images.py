"""The pictures that an incident page shows, with the portions that were damaged."""

import struct

import numpy as np

from auditor.model.measurement import REGION_STEP, Region
from auditor.model.pictures import Pictures
from auditor.model.rig import LIDAR
from auditor.reporting.incident.examples import data_uri
from auditor.reporting.incident.page import DamagedPortion, IncidentPart, View
from auditor.store.records import FrameErrors
from auditor.store.store import Store


def incident_views(
    store: Store,
    measurement_id: str,
    errors: FrameErrors,
    incident: IncidentPart,
    pictures: Pictures = Pictures.INCIDENTS,
) -> tuple[View, ...]:
    """The pictured frames of an incident: all, the strongest alone (`incidents`), or none.

    Of each frame the reference view with inconsistent pixels comes first, then the named ones. Where no camera is
    named, every other camera is shown, and the reference view itself where there is none. What an attacked sensor lost
    is drawn in the second kind: a camera's in its own picture, the LiDAR's in the reference's.
    """
    inside = (errors.frames >= incident.first_frame) & (errors.frames <= incident.last_frame)
    pictured = np.flatnonzero(inside & np.isin(errors.frames, store.pictured_frames(measurement_id)))
    if not len(pictured) or pictures == Pictures.NONE:
        return ()
    if pictures == Pictures.INCIDENTS:
        pictured = pictured[[np.argmax(np.nansum(errors.E[pictured], axis=1))]]
    frames = map(int, errors.frames[pictured])
    return tuple(view for frame in frames for view in _frame_views(store, measurement_id, frame, incident))


def _frame_views(store: Store, measurement_id: str, frame: int, incident: IncidentPart) -> tuple[View, ...]:
    picture = store.picture(measurement_id, frame)
    if picture is None or picture.reference not in picture.views:
        return ()
    images = {sensor: data_uri("jpg", jpeg) for sensor, jpeg in picture.views.items()}
    identified = [sensor for sensor in incident.attacked if sensor in images]
    others = [sensor for sensor in images if sensor != picture.reference and not incident.attacked]
    damaged = [r for r in store.load_regions(measurement_id, picture.frame) if r.sensor in incident.attacked]
    if any(region.sensor == LIDAR for region in damaged) and picture.reference not in identified:
        identified.append(picture.reference)
    mask = data_uri("png", picture.mask_png)
    return (
        View(picture.reference, picture.frame, images[picture.reference], mask),
        *(
            View(sensor, picture.frame, images[sensor], portions=tuple(map(_portion, _lying_in(damaged, sensor))))
            for sensor in identified or others or [picture.reference]
        ),
    )


def _lying_in(regions: list[Region], view: int) -> list[Region]:
    return [region for region in regions if region.view == view]


def _portion(region: Region) -> DamagedPortion:
    # A PNG tells its width and height after its signature and the head of its first chunk.
    width, height = struct.unpack(">II", region.mask[16:24])
    return DamagedPortion(
        sensor=region.sensor,
        width_px=width * REGION_STEP,
        height_px=height * REGION_STEP,
        mask=data_uri("png", region.mask),
        box_px=region.box_px,
        share=region.share,
        points=region.points,
        solid=region.solid,
    )

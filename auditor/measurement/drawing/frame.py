"""The pictures of one frame: what each camera recorded, the same with what is damaged, and the cloud."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

import cv2
import numpy as np

from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.rectification import shown_rectification
from auditor.measurement.drawing.clouds import ThingInFrame, range_image, seen_from_above, seen_together
from auditor.measurement.localisation.points import among
from auditor.model.arrays import Image, Mask, Points
from auditor.model.frames import Frame, PointCloud
from auditor.model.measurement import REGION_STEP, Region, Solid
from auditor.model.optics.geometry import invert
from auditor.model.pictures import Content, FramePicture
from auditor.model.rig import LIDAR, Camera, Rig

_SLACK_M = 0.01  # a stored box has lost the last digits of the points that it was put around


def damaged_image(region: Region, camera: Camera) -> Mask:
    """(H, W) mask of a camera's rectified image: the pixels of a region that lies in it."""
    small = np.asarray(cv2.imdecode(np.frombuffer(region.mask, np.uint8), cv2.IMREAD_GRAYSCALE))
    rows, columns = (np.arange(size) // REGION_STEP for size in (camera.height_px, camera.width_px))
    return np.asarray(small[np.ix_(rows, columns)] > 0)


def damaged_cloud(cloud: PointCloud, rig: Rig, regions: Iterable[Region], sensor: int = LIDAR) -> Mask:
    """(N,) mask of the points of a LiDAR's cloud: those of its regions. Raises RigError."""
    damaged, ideal = np.zeros(len(cloud.xyz_m), dtype=np.bool_), shown_rectification(rig).rig
    for region in regions:
        if region.sensor != sensor or sensor not in ideal.lidars:
            continue
        if not region.mask:
            damaged |= region.solid is not None and _inside(cloud.xyz_m, region.solid, ideal.alone(sensor))
        else:
            view = lidar_view(cloud, ideal, region.view)
            held = damaged_image(region, ideal.camera(region.view))[view.row, view.column]
            if region.solid is not None:
                held &= _inside(view.point_m, region.solid, ideal)
            damaged |= among(cloud.xyz_m, view.point_m[held])
    return damaged


def _inside(points: Points, solid: Solid, rig: Rig) -> Mask:
    """(M,) mask of the points in a box, as `solid_around` makes it."""
    assert rig.lidar is not None
    rotation = rig.lidar.rig_SE3_lidar[:3, :3]
    right, down, forward = ((points - np.array(solid.centre_m)) @ rotation.T).T
    turn = -np.deg2rad(solid.yaw_deg)
    across = right * np.cos(turn) + forward * np.sin(turn)
    along = forward * np.cos(turn) - right * np.sin(turn)
    halves = np.array(solid.size_m) / 2 + _SLACK_M
    beyond = np.abs([across, down, along]).T - halves
    return np.asarray(beyond.max(axis=1, initial=-np.inf) <= 0)


Form = Literal["jpg", "png"]

_JPEG_QUALITY = 90
_RED, _BLUE = (40, 40, 255), (255, 200, 0)  # BGR
_TINT = 0.35
_LINE_PX, _DOT_PX = 2, 3
_BLURRED_COLUMNS = 80
"""What a blurred image keeps of its width: of a number plate 60 px wide in 1242, four values."""


def draw_frame(frame: Frame, rig: Rig, regions: Sequence[Region], form: Form = "jpg") -> list[FramePicture]:
    """All pictures of a frame. `rig` is the recording's; `regions` are those measured of the frame.

    A camera without a damaged portion in its image has no overlay. Those of the cloud are PNG whatever the form.
    Raises RigError where the cameras have no view in common.
    """
    pictures = [
        FramePicture(frame.number, sensor, Content.COLOUR, form, _encoded(image.pixels, form))
        for sensor, image in sorted(frame.images.items())
    ]
    pictures += draw_overlays(frame, rig, regions, form)
    drawn = _clouds(frame, rig, regions)
    return pictures + [FramePicture(frame.number, *what, "png", _encoded(pixels, "png")) for what, pixels in drawn]


def _clouds(frame: Frame, rig: Rig, regions: Sequence[Region]) -> Iterator[tuple[tuple[int, Content], Image]]:
    """Each cloud as a range image, and all together from above."""
    points = {sensor: cloud.xyz_m for sensor, cloud in sorted(frame.clouds.items()) if sensor in rig.lidars}
    damaged = {sensor: damaged_cloud(frame.clouds[sensor], rig, regions, sensor) for sensor in points}
    if rig.others and points:
        yield (LIDAR, Content.ABOVE), seen_together(points, damaged, rig)
    for sensor, own in points.items():
        place = rig.lidars[sensor].rig_SE3_lidar
        if not rig.others:
            yield (sensor, Content.ABOVE), seen_from_above(own, damaged[sensor], place)
        framed = list(_went_through(frame, rig, regions, sensor)) if rig.others else ()
        yield (sensor, Content.RANGE), range_image(own, damaged[sensor], place, framed)


def _went_through(frame: Frame, rig: Rig, regions: Sequence[Region], by: int) -> Iterator[ThingInFrame]:
    """What the beams of a LiDAR went through, as it would see it."""
    lidar_SE3_rig = invert(rig.lidars[by].rig_SE3_lidar)
    for region in regions:
        if region.view == by != region.sensor and region.sensor in frame.clouds:
            cloud = frame.clouds[region.sensor]
            points = cloud.xyz_m[damaged_cloud(cloud, rig, [region], region.sensor)]
            place = lidar_SE3_rig @ rig.lidars[region.sensor].rig_SE3_lidar
            if len(points):
                yield ThingInFrame(region.sensor, (points @ place[:3, :3].T + place[:3, 3]).astype(np.float32))


def draw_overlays(frame: Frame, rig: Rig, regions: Sequence[Region], form: Form = "jpg") -> list[FramePicture]:
    """Those of the pictures of a frame that show what is damaged in cameras' images. Raises RigError."""
    ideal, pictures = shown_rectification(rig), []
    for sensor, image in sorted(frame.images.items()):
        own = [region for region in regions if region.view == sensor]
        if own:
            drawn = _overlaid(ideal.image(image).pixels, frame, ideal.rig, own)
            pictures.append(FramePicture(frame.number, sensor, Content.OVERLAY, form, _encoded(drawn, form)))
    return pictures


def blur_around(picture: FramePicture, rig: Rig, regions: Sequence[Region]) -> FramePicture:
    """A camera's picture in which all is blurred but the camera's own damaged portion; one of the cloud as it is.

    As recorded, the images of a rig that is not rectified are blurred whole: portions lie in rectified images. What is
    blurred has 80 columns left, so nothing brings its details back.
    """
    if picture.content in (Content.ABOVE, Content.RANGE):
        return picture
    pixels = np.asarray(cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR), dtype=np.uint8)
    height, width = pixels.shape[:2]
    kept_size = min(width, _BLURRED_COLUMNS), max(1, height * min(width, _BLURRED_COLUMNS) // width)
    few = cv2.resize(pixels, kept_size, interpolation=cv2.INTER_AREA)
    blurred = np.asarray(cv2.resize(few, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    ideal = shown_rectification(rig)
    if picture.content is Content.OVERLAY or not ideal.remaps:
        for region in regions:
            if region.view == region.sensor == picture.sensor:
                kept = damaged_image(region, ideal.rig.camera(picture.sensor))
                blurred[kept] = pixels[kept]
    return FramePicture(picture.frame, picture.sensor, picture.content, picture.form, _encoded(blurred, picture.form))


def _overlaid(pixels: Image, frame: Frame, rig: Rig, regions: Sequence[Region]) -> Image:
    drawn = pixels.copy() if pixels.ndim == 3 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for region in regions:
        if region.sensor == LIDAR:
            _dot(drawn, frame, rig, region)
        else:
            _tint(drawn, rig, region)
        left, top, right, bottom = region.box_px
        colour = _BLUE if region.sensor == LIDAR else _RED
        cv2.rectangle(drawn, (left, top), (right - 1, bottom - 1), colour, 1)
        text = f"S_{region.sensor}: {100 * region.share:.0f} %"
        place = (max(2, min(left, drawn.shape[1] - 90)), max(12, top - 4))
        cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 4, cv2.LINE_AA)
        cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return drawn


def _tint(drawn: Image, rig: Rig, region: Region) -> None:
    """Tint the damaged pixels of a camera, and draw a line around them."""
    mask = damaged_image(region, rig.camera(region.view))
    drawn[mask] = ((1 - _TINT) * drawn[mask] + _TINT * np.array(_RED)).astype(np.uint8)
    lines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(drawn, lines, -1, _RED, _LINE_PX)


def _dot(drawn: Image, frame: Frame, rig: Rig, region: Region) -> None:
    """Draw the damaged points of the LiDAR."""
    if frame.cloud is None:
        return
    view = lidar_view(frame.cloud, rig, region.view)
    held = damaged_image(region, rig.camera(region.view))[view.row, view.column]
    for row, column in zip(view.row[held].tolist(), view.column[held].tolist(), strict=True):
        cv2.circle(drawn, (column, row), _DOT_PX // 2, _BLUE, -1)


def _encoded(pixels: Image, form: str) -> bytes:
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if form == "jpg" else []
    _, data = cv2.imencode(f".{form}", pixels, options)
    return data.tobytes()

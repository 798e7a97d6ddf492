"""The same drive in the layouts of published data sets, of their documents' own fields."""

import gzip
import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow
import pyarrow.feather

from auditor.model.frames import Frame
from auditor.model.optics.geometry import (
    Matrix,
    compose,
    invert,
    motion,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from auditor.model.rig import Camera, Rig
from auditor.recordings.decoding.pictures import encode_picture
from tests.making.pickled_tables import pickled

WriteFolder = Callable[[Path, Rig, list[Frame]], Path]


def vehicle_SE3_camera(camera: Camera) -> Matrix:
    return motion(camera.rotation.T, camera.centre_m)


def _places(rig: Rig) -> dict[str, Matrix]:
    assert rig.lidar
    return {"LIDAR": rig.lidar.rig_SE3_lidar} | {f"CAM_{c.number}": vehicle_SE3_camera(c) for c in rig.cameras}


def _put(file: Path, data: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def _with_intensity(xyz_m: np.ndarray) -> np.ndarray:
    return np.column_stack([xyz_m, np.ones(len(xyz_m), np.float32)])


def _dgp_motion(place: Matrix) -> dict[str, dict[str, float]]:
    quaternion = dict(zip(("qx", "qy", "qz", "qw"), map(float, quaternion_from_rotation(place[:3, :3])), strict=True))
    return {"rotation": quaternion, "translation": dict(zip("xyz", map(float, place[:3, 3]), strict=True))}


def write_dgp(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
    data: list[dict[str, Any]] = []

    def note(name: str, stamp_ns: int, kind: str, datum: dict[str, Any]) -> None:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=stamp_ns // 1000)
        stamp = moment.isoformat().replace("+00:00", "Z")
        data.append({"id": {"name": name, "timestamp": stamp}, "datum": {kind: datum}, "key": str(len(data))})

    for frame in frames:
        for number, image in frame.images.items():
            name = f"rgb/CAM_{number}/{image.stamp_ns}.png"
            _put(folder / name, encode_picture(image.pixels, "png"))
            height, width = image.pixels.shape[:2]
            note(f"CAM_{number}", image.stamp_ns, "image", {"filename": name, "width": width, "height": height})
        packed = BytesIO()
        np.savez_compressed(packed, data=_with_intensity(frame.cloud.xyz_m).astype(np.float64))
        name = f"point_cloud/LIDAR/{frame.cloud.stamp_ns}.npz"
        _put(folder / name, packed.getvalue())
        note(
            "LIDAR",
            frame.cloud.stamp_ns,
            "point_cloud",
            {"filename": name, "point_format": ["X", "Y", "Z", "INTENSITY"]},
        )
    intrinsics = [{"fx": 0.0, "fy": 0.0, "cx": 0.0, "cy": 0.0, "skew": 0.0}]
    for camera in rig.cameras:
        (fx, skew, cx), (_, fy, cy), _ = camera.intrinsics.tolist()
        intrinsics.append({"fx": fx, "fy": fy, "cx": cx, "cy": cy, "skew": skew})
    places = _places(rig)
    calibration = {
        "names": list(places),
        "extrinsics": [_dgp_motion(p) for p in places.values()],
        "intrinsics": intrinsics,
    }
    _put(folder / "calibration" / "abc.json", json.dumps(calibration).encode())
    scene = {"data": data, "samples": [{"calibration_key": "abc"}], "name": "scene"}
    _put(folder / "scene_abc.json", json.dumps(scene).encode())
    return folder


def write_argoverse(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
    places = {name.replace("LIDAR", "up_lidar"): place for name, place in _places(rig).items()}
    names = ("qx", "qy", "qz", "qw")
    rows = [
        {"sensor_name": name, **dict(zip(names, map(float, quaternion_from_rotation(place[:3, :3])), strict=True))}
        | dict(zip(("tx_m", "ty_m", "tz_m"), map(float, place[:3, 3]), strict=True))
        for name, place in places.items()
    ]
    intrinsics = [
        {
            **{"sensor_name": f"CAM_{c.number}", "fx_px": c.intrinsics[0, 0], "fy_px": c.intrinsics[1, 1]},
            **{"cx_px": c.intrinsics[0, 2], "cy_px": c.intrinsics[1, 2], "k1": -0.25, "k2": -0.2, "k3": 0.3},
            **{"height_px": c.height_px, "width_px": c.width_px},
        }
        for c in rig.cameras
    ]
    (folder / "calibration").mkdir(parents=True)
    for name, table in (("egovehicle_SE3_sensor", rows), ("intrinsics", intrinsics)):
        pyarrow.feather.write_feather(pyarrow.Table.from_pylist(table), folder / "calibration" / f"{name}.feather")
    for frame in frames:
        for number, image in frame.images.items():
            file = folder / "sensors" / "cameras" / f"CAM_{number}" / f"{image.stamp_ns}.jpg"
            _put(file, cv2.imencode(".jpg", image.pixels, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes())
        vehicle_SE3_lidar = places["up_lidar"]
        xyz = frame.cloud.xyz_m @ vehicle_SE3_lidar[:3, :3].T + vehicle_SE3_lidar[:3, 3]
        columns = {axis: xyz[:, place].astype(np.float32) for place, axis in enumerate("xyz")}
        table = pyarrow.table(columns | {"intensity": np.ones(len(xyz), np.uint8)})
        file = folder / "sensors" / "lidar" / f"{frame.cloud.stamp_ns}.feather"
        file.parent.mkdir(parents=True, exist_ok=True)
        pyarrow.feather.write_feather(table, file)
    return folder


def write_nuscenes(folder: Path, rig: Rig, frames: list[Frame], scenes: int = 1) -> Path:
    sensors, calibrated, data = [], [], []
    for name, place in _places(rig).items():
        x, y, z, w = map(float, quaternion_from_rotation(place[:3, :3]))
        modality = "lidar" if name == "LIDAR" else "camera"
        K = [] if modality == "lidar" else rig.camera(int(name[-1])).intrinsics.tolist()
        sensors.append({"token": f"s{name}", "channel": name, "modality": modality})
        calibrated.append(
            {"token": f"c{name}", "sensor_token": f"s{name}", "translation": place[:3, 3].tolist()}
            | {"rotation": [w, x, y, z], "camera_intrinsic": K}
        )
    sensors.append({"token": "sRADAR", "channel": "RADAR_FRONT", "modality": "radar"})
    calibrated.append({"token": "cRADAR", "sensor_token": "sRADAR", "translation": [0, 0, 0], "rotation": [1, 0, 0, 0]})
    data.append({"calibrated_sensor_token": "cRADAR", "timestamp": 5, "filename": "samples/RADAR_FRONT/1.pcd"})
    for frame in frames:
        files = [(f"CAM_{n}", i.stamp_ns, "png", encode_picture(i.pixels, "png")) for n, i in frame.images.items()]
        points = np.column_stack([_with_intensity(frame.cloud.xyz_m), np.zeros(len(frame.cloud.xyz_m), np.float32)])
        files.append(("LIDAR", frame.cloud.stamp_ns, "pcd.bin", points.astype("<f4").tobytes()))
        for name, stamp_ns, ending, content in files:
            filename = f"{'samples' if frame.number == 0 else 'sweeps'}/{name}/x__{name}__{stamp_ns // 1000}.{ending}"
            _put(folder / filename, content)
            size = {} if name == "LIDAR" else {"width": rig.cameras[0].width_px, "height": rig.cameras[0].height_px}
            row = {"calibrated_sensor_token": f"c{name}", "timestamp": stamp_ns // 1000, "filename": filename}
            data.append({**row, "sample_token": f"scene-{frame.number % scenes}", **size})
    tables = {
        "scene": [{"token": f"t{n}", "name": f"scene-{n}"} for n in range(scenes)],
        "sample": [{"token": f"scene-{n}", "scene_token": f"t{n}"} for n in range(scenes)],
        "sensor": sensors,
        "calibrated_sensor": calibrated,
        "sample_data": [{"token": str(number), "sample_token": "scene-0", **row} for number, row in enumerate(data)],
    }
    for name, rows in tables.items():
        _put(folder / "v1.0-mini" / f"{name}.json", json.dumps(rows).encode())
    return folder


def write_kitti_360(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
    """The two leftmost cameras, which its calibration calls 00 and 01, and the LiDAR."""
    drive = "2013_05_28_drive_0000_sync"
    pictures, scans = folder / "data_2d_raw" / drive, folder / "data_3d_raw" / drive / "velodyne_points"
    left, right = rig.camera(rig.n), rig.camera(rig.n - 1)
    lines = []
    for name, camera in (("00", left), ("01", right)):
        P = np.hstack([camera.intrinsics, -camera.intrinsics @ (camera.centre_m - left.centre_m)[:, None]])
        lines += [f"S_rect_{name}: {camera.width_px} {camera.height_px}", f"P_rect_{name}: {_text(P)}"]
        lines.append(f"R_rect_{name}: {_text(np.eye(3))}")
    assert rig.lidar
    lidar_SE3_cam0 = invert(rig.lidar.rig_SE3_lidar) @ vehicle_SE3_camera(left)
    _put(folder / "calibration" / "perspective.txt", "\n".join(lines).encode())
    _put(folder / "calibration" / "calib_cam_to_velo.txt", _text(lidar_SE3_cam0[:3]).encode())
    for frame in frames:
        for name, camera in (("00", left), ("01", right)):
            data = encode_picture(frame.images[camera.number].pixels, "png")
            _put(pictures / f"image_{name}" / "data_rect" / f"{frame.number:010}.png", data)
        points = _with_intensity(frame.cloud.xyz_m).astype("<f4")
        _put(scans / "data" / f"{frame.number:010}.bin", points.tobytes())
    stamps = "\n".join(
        datetime.fromtimestamp(f.stamp_ns / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S.%f") + "000" for f in frames
    )
    for place in (pictures / "image_00", pictures / "image_01", scans):
        (place / "timestamps.txt").write_text(stamps)
    return pictures


def world_SE3_rig(stamp_ns: int, first_ns: int) -> Matrix:
    """A vehicle that drives evenly at 12 m/s and turns by 0.1 rad a second, somewhere in the world."""
    seconds = (stamp_ns - first_ns) / 1e9
    angle = 0.7 + 0.1 * seconds
    turned = rotation_from_quaternion(0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))
    return motion(turned, np.array([300.0 + 12 * seconds, -50.0, 2.0]))


def write_pandaset(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
    """Its front camera is S_1; points of another LiDAR (d = 1) lie before each picture, 1 m away."""
    names = {1: "front_camera"} | {n: f"left_camera_{n}" for n in range(2, rig.n + 1)}
    first_ns, rig_SE3_lidar = frames[0].stamp_ns, rig.lidar.rig_SE3_lidar if rig.lidar else np.eye(4)
    for number, name in names.items():
        at, camera = folder / "camera" / name, rig.camera(number)
        (fx, _, cx), (_, fy, cy), _ = camera.intrinsics.tolist()
        poses, stamps = [], []
        for frame in frames:
            image = frame.images[number]
            picture = cv2.imencode(".jpg", image.pixels, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
            _put(at / f"{frame.number:02}.jpg", picture)
            pose = compose(world_SE3_rig(image.stamp_ns, first_ns), vehicle_SE3_camera(camera))
            x, y, z, w = map(float, quaternion_from_rotation(pose[:3, :3]))
            position = dict(zip("xyz", map(float, pose[:3, 3]), strict=True))
            poses.append({"position": position, "heading": {"w": w, "x": x, "y": y, "z": z}})
            stamps.append(image.stamp_ns / 1e9)
        described = {"intrinsics": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}, "poses": poses, "timestamps": stamps}
        for what, content in described.items():
            _put(at / f"{what}.json", json.dumps(content).encode())
    for frame in frames:
        world_SE3_lidar = compose(world_SE3_rig(frame.stamp_ns, first_ns), rig_SE3_lidar)
        near = np.tile(rig.camera(1).centre_m + rig.camera(1).rotation.T @ [0, 0, 1.0], (5, 1))
        there = np.vstack([frame.cloud.xyz_m, near]) @ world_SE3_lidar[:3, :3].T + world_SE3_lidar[:3, 3]
        columns = dict(zip("xyz", there.T, strict=True)) | {"i": np.full(len(there), 7.0)}
        columns |= {"t": np.full(len(there), frame.stamp_ns / 1e9), "d": np.repeat([0, 1], [len(there) - 5, 5])}
        _put(folder / "lidar" / f"{frame.number:02}.pkl.gz", gzip.compress(pickled(columns)))
    return folder


def _text(matrix: Matrix) -> str:
    return " ".join(repr(float(value)) for value in matrix.reshape(-1))

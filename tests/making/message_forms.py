"""The same drive in every supported message form, by the real writers."""

import gzip
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import CameraImage, Frame, PointCloud, Presence, SensorState
from auditor.model.rig import Rig
from auditor.recordings import schemas
from auditor.recordings.decoding.pictures import encode_picture
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers import frames as frames_writer
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making.cloudini import cloudini
from tests.making.foxglove_messages import FoxgloveMessage, messages_of, transform, write_json, write_protobuf
from tests.making.scenes import FOCAL, HEIGHT, WIDTH, plane_cloud
from tests.making.videos import ENCODERS, encoded

Pixels = NDArray[np.uint8]
Write = Callable[[Path, Rig, list[Frame]], Path]


class MessageForm(NamedTuple):
    """One row of the table; `lossless` forms must give the same counts, the others nearly the same E."""

    name: str
    write: Write
    lossless: bool = True
    needs: str = ""

    @property
    def is_there(self) -> bool:
        """True where the package of an extra that the form needs is installed; that of videos is `av`."""
        needs = "av" if self.name.split()[-1] in ENCODERS else self.needs
        return not needs or find_spec(needs) is not None


def drive(rig: Rig, count: int) -> list[Frame]:
    """A coloured plane that comes nearer, smooth as camera pictures are; half of S_2 is blinded in the last frame."""
    made = []
    for number in range(count):
        rng = np.random.default_rng(number)
        texture = cv2.GaussianBlur(rng.integers(0, 256, (HEIGHT, 3 * WIDTH, 3)).astype(np.float32), (0, 0), 1.5)
        texture = np.clip(128 + 3 * (texture - 128), 0, 255).astype(np.uint8)
        depth_m, stamp_ns = 15.0 - 3 * number, (1_700_000_000 * 10 + number) * 10**8
        images = {}
        for camera in rig.cameras:
            shift = round(FOCAL * float(camera.centre_m[0]) / depth_m)
            pixels = np.ascontiguousarray(texture[:, WIDTH + shift : 2 * WIDTH + shift])
            if camera.number == 2 and number == count - 1:
                pixels[:, WIDTH // 2 :] = 250
            images[camera.number] = CameraImage(camera.number, stamp_ns, pixels)
        cloud = PointCloud(stamp_ns, plane_cloud(depth_m))
        made.append(Frame(number, stamp_ns, {s: Presence(SensorState.PRESENT, 0) for s in rig.sensors}, cloud, images))
    return made


def grey(bgr: Pixels) -> Pixels:
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)


def twice(values: Pixels, *, big_endian: bool = False) -> Pixels:
    """Values of 16 bits whose upper 8 are these, as bytes."""
    wide = (values.astype(np.uint16) << 8) + 77
    return wide.astype(">u2" if big_endian else "<u2").view(np.uint8)


def mosaic(bgr: Pixels, order: str) -> Pixels:
    out = np.empty(bgr.shape[:2], np.uint8)
    for place, colour in enumerate(order):
        row, column = divmod(place, 2)
        out[row::2, column::2] = bgr[row::2, column::2, "bgr".index(colour)]
    return out


def semi_planar(bgr: Pixels, *, swapped: bool) -> Pixels:
    """NV12, or NV21: the rows of Y, then rows of the interleaved chroma."""
    height, width = bgr.shape[:2]
    planes = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
    chroma = planes[height:].reshape(2, -1)[:: -1 if swapped else 1]
    return np.vstack([planes[:height], np.ascontiguousarray(chroma.T).reshape(height // 2, width)])


def padded(rows: Pixels) -> Pixels:
    rows = rows.reshape(len(rows), -1)
    return np.hstack([rows, np.full((len(rows), 24), 9, np.uint8)])


class Raw(NamedTuple):
    """Bytes of a raw image under an encoding; `rows` is (rows, bytes a row)."""

    encoding: str
    rows: Callable[[Pixels], Pixels]
    lossless: bool = True
    big_endian: bool = False


def _bayer(order: str, bits: int) -> Raw:
    def rows(bgr: Pixels) -> Pixels:
        return mosaic(bgr, order) if bits == 8 else twice(mosaic(bgr, order))

    return Raw(f"bayer_{order}{bits}", rows, lossless=False)


RAW = (
    Raw("bgr8", lambda bgr: bgr),
    Raw("8UC3", lambda bgr: bgr),
    Raw("passthrough", lambda bgr: bgr),
    Raw("rgb8", lambda bgr: bgr[:, :, ::-1]),
    Raw("bgra8", lambda bgr: np.dstack([bgr, bgr[:, :, 0]])),
    Raw("8UC4", lambda bgr: np.dstack([bgr, bgr[:, :, 0]])),
    Raw("rgba8", lambda bgr: np.dstack([bgr[:, :, ::-1], bgr[:, :, 0]])),
    Raw("mono8", grey),
    Raw("8UC1", grey),
    Raw("mono16", lambda bgr: twice(grey(bgr))),
    Raw("16UC1", lambda bgr: twice(grey(bgr), big_endian=True), big_endian=True),
    *(_bayer(order, bits) for order in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)),
    Raw("yuv422", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_UYVY), lossless=False),
    Raw("uyvy", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_UYVY), lossless=False),
    Raw("yuv422_yuy2", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_YUY2), lossless=False),
    Raw("yuyv", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_YUY2), lossless=False),
    Raw("nv12", lambda bgr: semi_planar(bgr, swapped=False), lossless=False),
    Raw("nv21", lambda bgr: semi_planar(bgr, swapped=True), lossless=False),
    Raw("i420", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420), lossless=False),
    Raw("yv12", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_YV12), lossless=False),
    Raw("yvyu", lambda bgr: cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_YVYU), lossless=False),
    Raw("BayerRG8", lambda bgr: mosaic(bgr, "rggb"), lossless=False),
    Raw("RGB8", lambda bgr: bgr[:, :, ::-1]),
    Raw("rgb16", lambda bgr: twice(bgr[:, :, ::-1])),
    Raw("bgra16", lambda bgr: twice(np.dstack([bgr, bgr[:, :, 0]]))),
)


class Layout(NamedTuple):
    """Points in memory: a structured type, in rows of `width` (0: one row) with `row_padding` bytes behind each."""

    name: str
    dtype: np.dtype[np.void]
    width: int = 0
    row_padding: int = 0
    with_nan: bool = False

    @property
    def big_endian(self) -> bool:
        return self.dtype["x"].byteorder == ">"


def _dtype(names: str, formats: str, offsets: tuple[int, ...] | None = None, itemsize: int = 0) -> np.dtype[np.void]:
    description: dict[str, Any] = {"names": names.split(), "formats": formats.split()}
    return np.dtype({**description, "offsets": offsets, "itemsize": itemsize} if offsets else description)


LAYOUTS = (
    Layout("x y z intensity", _dtype("x y z intensity", "<f4 <f4 <f4 <f4")),
    Layout("x y z i", _dtype("x y z i", "<f4 <f4 <f4 <u1")),
    Layout("other order, padding, t", _dtype("t z x ring y", "<u4 <f4 <f4 <u2 <f4", (0, 4, 9, 13, 20), 32)),
    Layout("float64, timestamp", _dtype("x y z timestamp", "<f8 <f8 <f8 <f8")),
    Layout("big-endian, time", _dtype("x y z time", ">f4 >f4 >f4 >f4")),
    Layout("NaN, offset_time", _dtype("offset_time x y z", "<u4 <f4 <f4 <f4"), with_nan=True),
    Layout("organised, rows padded", _dtype("x y z", "<f4 <f4 <f4"), width=WIDTH // 2, row_padding=20),
    Layout("stride of 20", _dtype("x y z intensity ring", "<f4 <f4 <f4 <f4 <f4")),
)

ROS_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
FOXGLOVE_DATATYPES = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "f4": 7, "f8": 8}


def packed(xyz_m: NDArray[np.float32], layout: Layout) -> NDArray[np.void]:
    """The points in a layout; with NaN, every tenth is followed by one where nothing came back."""
    if layout.with_nan:
        xyz_m = np.insert(xyz_m, range(0, len(xyz_m), 10), np.nan, axis=0)
    points = np.zeros(len(xyz_m), layout.dtype)
    for column, name in enumerate("xyz"):
        points[name] = xyz_m[:, column]
    return points


def ros(
    encoding: str = "cdr",
    *,
    raw: Raw | None = None,
    picture: tuple[str, str] | None = None,
    layout: Layout | None = None,
    cloud: Callable[[MessageMaker, NDArray[np.float32], int], tuple[str, bytes]] | None = None,
) -> Write:
    """An MCAP file of ROS messages; `picture` is what a compressed image holds, and what its format declares."""

    def write(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
        maker = MessageMaker("ros1" if encoding == "ros1" else "cdr")
        images = {(rig.topic(n), i.stamp_ns): i.pixels for f in frames for n, i in f.images.items()}
        clouds = {f.cloud.stamp_ns: f.cloud.xyz_m for f in frames if f.cloud}
        tracks = _tracks(rig, frames, picture[0]) if picture and picture[0] in ENCODERS else {}
        with mcap_file(folder / "a.mcap", profile="ros1" if encoding == "ros1" else "ros2", compression="zstd") as file:
            for topic, schema, stamp_ns, data in frames_writer._messages(maker, rig, frames, {}):
                frame_id = topic.strip("/")
                if schema == schemas.IMAGE and (raw or picture):
                    frame_id = rig.camera(int(topic[-1])).name
                if tracks and schema == schemas.IMAGE:
                    assert picture
                    packet = next(tracks[topic])
                    schema, data = _ros_video(maker, packet, picture, stamp_ns, frame_id)  # noqa: PLW2901
                elif schema == schemas.IMAGE and (raw or picture):
                    schema, data = _ros_image(maker, images[topic, stamp_ns], stamp_ns, frame_id, raw, picture)  # noqa: PLW2901
                elif schema == schemas.POINT_CLOUD and cloud:
                    schema, data = cloud(maker, clouds[stamp_ns], stamp_ns)  # noqa: PLW2901
                elif schema == schemas.POINT_CLOUD and layout:
                    data = _ros_cloud(maker, packed(clouds[stamp_ns], layout), stamp_ns, layout)  # noqa: PLW2901
                kind = "ros1msg" if encoding == "ros1" else "ros2msg"
                name = schema.replace("/msg/", "/") if encoding == "ros1" else schema
                definition = Definition(kind, maker.definition(schema).encode())
                file.write(Topic(topic, name, encoding), definition, stamp_ns, data)
        return folder / "a.mcap"

    return write


def _ros_video(
    maker: MessageMaker, packet: bytes, picture: tuple[str, str], stamp_ns: int, frame_id: str
) -> tuple[str, bytes]:
    """A packet as CompressedImage, or as one of the messages made for videos, which the latter part names."""
    video, form = picture
    if form == schemas.FFMPEG_PACKET:
        named = {
            "encoding": ENCODERS[video][0],
            "width": WIDTH,
            "height": HEIGHT,
            "pts": 0,
            "flags": 0,
            "is_bigendian": False,
        }
        head = {"header": maker.header(stamp_ns, frame_id)}
    elif form == schemas.FOXGLOVE_VIDEO:
        named = {"format": video}
        stamp = maker.store.types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
        head = {"timestamp": stamp, "frame_id": frame_id}
    else:
        return schemas.COMPRESSED_IMAGE, maker.compressed_image(packet, form, stamp_ns, frame_id)
    made = maker._made(form, **head, **named, data=np.frombuffer(packet, np.uint8))
    return form, maker.serialise(form, made)


def file_of(pixels: Pixels | NDArray[np.uint16], form: str) -> bytes:
    """A picture file without loss: webp, bmp, tiff, jp2 or avif."""
    lossless = {
        "webp": [cv2.IMWRITE_WEBP_QUALITY, 101],
        "jp2": [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000],
        "avif": [cv2.IMWRITE_AVIF_QUALITY, 100, *([cv2.IMWRITE_AVIF_DEPTH, 12] if pixels.dtype == np.uint16 else [])],
    }
    done, data = cv2.imencode(f".{form}", pixels, lossless.get(form, []))
    assert done
    return data.tobytes()


def _ros_image(
    maker: MessageMaker, bgr: Pixels, stamp_ns: int, frame_id: str, raw: Raw | None, picture: tuple[str, str] | None
) -> tuple[str, bytes]:
    if picture:
        form, declared_format = picture
        data = encode_picture(bgr, form) if form in {"png", "jpeg"} else file_of(bgr, form)
        return schemas.COMPRESSED_IMAGE, maker.compressed_image(data, declared_format, stamp_ns, frame_id)
    assert raw
    rows = np.ascontiguousarray(raw.rows(bgr))
    image = maker._made(
        schemas.IMAGE,
        header=maker.header(stamp_ns, frame_id),
        height=bgr.shape[0],
        width=bgr.shape[1],
        encoding=raw.encoding,
        is_bigendian=int(raw.big_endian),
        step=rows.size // len(rows),
        data=rows.reshape(-1),
    )
    return schemas.IMAGE, maker.serialise(schemas.IMAGE, image)


def _ros_cloud(maker: MessageMaker, points: NDArray[np.void], stamp_ns: int, layout: Layout) -> bytes:
    width = layout.width or len(points)
    rows = points.view(np.uint8).reshape(len(points) // width, -1)
    rows = np.hstack([rows, np.zeros((len(rows), layout.row_padding), np.uint8)])
    fields = [
        maker._made(
            "sensor_msgs/msg/PointField", name=name, offset=offset, datatype=ROS_DATATYPES[kind.str[1:]], count=1
        )
        for name, (kind, offset) in layout.dtype.fields.items()
    ]
    cloud = maker._made(
        schemas.POINT_CLOUD,
        header=maker.header(stamp_ns, "lidar"),
        height=len(rows),
        width=width,
        fields=fields,
        is_bigendian=layout.big_endian,
        point_step=layout.dtype.itemsize,
        row_step=rows.shape[1],
        data=rows.reshape(-1),
        is_dense=not layout.with_nan,
    )
    return maker.serialise(schemas.POINT_CLOUD, cloud)


def livox_cloud(maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int) -> tuple[str, bytes]:
    schema = schemas.LIVOX[0 if maker.encoding == "ros1" else 1]
    point = maker.store.types[schema.replace("CustomMsg", "CustomPoint")]
    points = [point(n, *map(float, xyz), reflectivity=9, tag=0, line=1) for n, xyz in enumerate(xyz_m)]
    head = maker.header(stamp_ns, "lidar")
    made = maker._made(
        schema,
        header=head,
        timebase=stamp_ns,
        point_num=len(xyz_m),
        lidar_id=0,
        rsvd=np.zeros(3, np.uint8),
        points=points,
    )
    return schema, maker.serialise(schema, made)


def draco_cloud(maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int) -> tuple[str, bytes]:
    import DracoPy  # noqa: PLC0415 - an extra

    packed = DracoPy.encode(xyz_m, quantization_bits=16, preserve_order=True)
    return compressed_cloud(maker, xyz_m, stamp_ns, packed, "draco")


def cloudini_cloud(maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int) -> tuple[str, bytes]:
    return compressed_cloud(maker, xyz_m, stamp_ns, cloudini(xyz_m), "cloudini")


def zlib_cloud(maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int) -> tuple[str, bytes]:
    return compressed_cloud(maker, xyz_m, stamp_ns, gzip.compress(xyz_m.tobytes(), 1), "zlib")


def compressed_cloud(
    maker: MessageMaker, xyz_m: NDArray[np.float32], stamp_ns: int, packed: bytes, form: str
) -> tuple[str, bytes]:
    field = maker.store.types["sensor_msgs/msg/PointField"]
    made = maker._made(
        schemas.COMPRESSED_CLOUD,
        header=maker.header(stamp_ns, "lidar"),
        height=1,
        width=len(xyz_m),
        fields=[field(name=name, offset=4 * place, datatype=7, count=1) for place, name in enumerate("xyz")],
        is_bigendian=False,
        point_step=12,
        row_step=12 * len(xyz_m),
        compressed_data=np.frombuffer(packed, np.uint8),
        is_dense=True,
        format=form,
    )
    return schemas.COMPRESSED_CLOUD, maker.serialise(schemas.COMPRESSED_CLOUD, made)


def foxglove(
    encoding: str,
    change: Callable[[Rig, list[Frame], Iterator[FoxgloveMessage]], Iterator[FoxgloveMessage]],
    **how: Any,
) -> Write:
    """An MCAP file of foxglove messages, in protobuf or json."""

    def write(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
        messages = change(rig, frames, messages_of(rig, frames, **how))
        (write_json if encoding == "json" else write_protobuf)(folder / "a.mcap", messages)
        return folder / "a.mcap"

    return write


def as_raw(raw: Raw) -> Callable[[Rig, list[Frame], Iterator[FoxgloveMessage]], Iterator[FoxgloveMessage]]:
    def change(rig: Rig, frames: list[Frame], messages: Iterator[FoxgloveMessage]) -> Iterator[FoxgloveMessage]:
        images = {(rig.topic(n), i.stamp_ns): i.pixels for f in frames for n, i in f.images.items()}
        for one in messages:
            if one.schema == "foxglove.RawImage":
                rows = np.ascontiguousarray(raw.rows(images[one.topic, one.time_ns]))
                fields = {"encoding": raw.encoding, "step": rows.size // len(rows), "data": rows.tobytes()}
                yield one._replace(fields={**one.fields, **fields})
            else:
                yield one

    return change


def _tracks(rig: Rig, frames: list[Frame], form: str) -> dict[str, Iterator[bytes]]:
    """By topic the packets of a camera's video."""
    return {rig.topic(n): iter(encoded([f.images[n].pixels for f in frames], 4, form)) for n in range(1, rig.n + 1)}


def as_video(
    rig: Rig, frames: list[Frame], messages: Iterator[FoxgloveMessage], form: str
) -> Iterator[FoxgloveMessage]:
    tracks = _tracks(rig, frames, form)
    for one in messages:
        if one.schema == "foxglove.RawImage":
            head = {name: one.fields[name] for name in ("timestamp", "frame_id")}
            fields = {**head, "data": next(tracks[one.topic]), "format": form}
            yield FoxgloveMessage(one.topic, "foxglove.CompressedVideo", one.time_ns, fields)
        else:
            yield one


def with_layout(layout: Layout) -> Callable[[Rig, list[Frame], Iterator[FoxgloveMessage]], Iterator[FoxgloveMessage]]:
    def change(_: Rig, frames: list[Frame], messages: Iterator[FoxgloveMessage]) -> Iterator[FoxgloveMessage]:
        clouds = {f.cloud.stamp_ns: f.cloud.xyz_m for f in frames if f.cloud}
        for one in messages:
            if one.schema == "foxglove.PointCloud":
                fields = {
                    "point_stride": layout.dtype.itemsize,
                    "fields": [
                        {"name": name, "offset": offset, "type": FOXGLOVE_DATATYPES[kind.str[1:]]}
                        for name, (kind, offset) in layout.dtype.fields.items()
                    ],
                    "data": packed(clouds[one.time_ns], layout).tobytes(),
                }
                yield one._replace(fields={**one.fields, **fields})
            else:
                yield one

    return change


def posed(_: Rig, __: list[Frame], messages: Iterator[FoxgloveMessage]) -> Iterator[FoxgloveMessage]:
    """Points 8 m further to the front than they are, in a frame that a pose brings back: exact in binary numbers."""
    for one in messages:
        if one.schema == "foxglove.PointCloud":
            points = np.frombuffer(one.fields["data"], np.float32).reshape(-1, 3) + np.float32([8, 0, 0])
            back = transform("", "", np.array([[1, 0, 0, -8], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), 0)
            pose = {"position": back["translation"], "orientation": back["rotation"]}
            yield one._replace(fields={**one.fields, "data": points.tobytes(), "pose": pose})
        else:
            yield one


def same(_: Rig, __: list[Frame], messages: Iterator[FoxgloveMessage]) -> Iterator[FoxgloveMessage]:
    return messages


def through_container(write: Callable[..., Path]) -> Write:
    return lambda folder, rig, frames: write(folder, rig, frames, "raw")


def greyed(write: Write) -> Write:
    """Grey pictures: what messages_of() then calls mono8."""

    def grey_first(folder: Path, rig: Rig, frames: list[Frame]) -> Path:
        made = [replace(f, images={n: replace(i, pixels=grey(i.pixels)) for n, i in f.images.items()}) for f in frames]
        return write(folder, rig, made)

    return grey_first


FORMS = (
    *(MessageForm(f"ROS 2 Image {raw.encoding}", ros(raw=raw), raw.lossless) for raw in RAW),
    MessageForm("ROS 2 Image bgr8, rows padded", ros(raw=Raw("bgr8", padded))),
    MessageForm("ROS 2 CompressedImage png", ros(picture=("png", "png"))),
    MessageForm("ROS 2 CompressedImage bgr8; png compressed", ros(picture=("png", "bgr8; png compressed bgr8"))),
    *(MessageForm(f"ROS 2 CompressedImage {f}", ros(picture=(f, f))) for f in ("webp", "bmp", "tiff", "jp2", "avif")),
    MessageForm("ROS 2 CompressedImage jpeg", ros(picture=("jpeg", "jpeg")), lossless=False),
    MessageForm(
        "ROS 2 CompressedImage bgr8; jpeg compressed",
        ros(picture=("jpeg", "bgr8; jpeg compressed bgr8")),
        lossless=False,
    ),
    *(MessageForm(f"ROS 2 CompressedImage {f}", ros(picture=(f, f)), lossless=False) for f in ENCODERS),
    *(
        MessageForm(f"ROS 2 FFMPEGPacket {f}", ros(picture=(f, schemas.FFMPEG_PACKET)), lossless=False)
        for f in ENCODERS
    ),
    MessageForm("ROS 1 FFMPEGPacket h264", ros("ros1", picture=("h264", schemas.FFMPEG_PACKET)), lossless=False),
    MessageForm("ROS 2 CompressedVideo h264", ros(picture=("h264", schemas.FOXGLOVE_VIDEO)), lossless=False),
    MessageForm("ROS 1 CompressedImage h264", ros("ros1", picture=("h264", "h264")), lossless=False),
    MessageForm("ROS 1 Image rgb8", ros("ros1", raw=RAW[3])),
    MessageForm("ROS 1 CompressedImage png", ros("ros1", picture=("png", "png"))),
    MessageForm("ROS 1 CompressedImage jpeg", ros("ros1", picture=("jpeg", "jpeg")), lossless=False),
    *(MessageForm(f"ROS 2 PointCloud2 {layout.name}", ros(layout=layout)) for layout in LAYOUTS),
    MessageForm("ROS 1 PointCloud2 organised", ros("ros1", layout=LAYOUTS[6])),
    MessageForm("ROS 1 livox_ros_driver/CustomMsg", ros("ros1", cloud=livox_cloud)),
    MessageForm("ROS 2 livox_ros_driver2/CustomMsg", ros(cloud=livox_cloud)),
    MessageForm("ROS 2 CompressedPointCloud2 zlib", ros(cloud=zlib_cloud)),
    MessageForm("ROS 2 CompressedPointCloud2 cloudini", ros(cloud=cloudini_cloud), lossless=False),
    MessageForm("ROS 2 CompressedPointCloud2 draco", ros(cloud=draco_cloud), lossless=False, needs="DracoPy"),
)

FOXGLOVE_FORMS = tuple(
    row
    for form in ("protobuf", "json")
    for row in (
        *(
            MessageForm(f"{form} RawImage {raw.encoding}", foxglove(form, as_raw(raw)), raw.lossless)
            for raw in RAW
            if raw.encoding in {"bgr8", "rgb8", "mono8", "mono16", "bayer_rggb8", "yuv422", "nv12"}
        ),
        MessageForm(f"{form} RawImage grey", greyed(foxglove(form, same))),
        MessageForm(f"{form} CompressedImage png", foxglove(form, same, form="png")),
        MessageForm(f"{form} CompressedImage jpeg", foxglove(form, same, form="jpeg"), lossless=False),
        *(
            MessageForm(
                f"{form} CompressedVideo {video}", foxglove(form, partial(as_video, form=video)), lossless=False
            )
            for video in ("h264", "h265", "av1", "vp9")
        ),
        *(
            MessageForm(f"{form} PointCloud {layout.name}", foxglove(form, with_layout(layout)))
            for layout in LAYOUTS
            if not layout.width and not layout.big_endian
        ),
        MessageForm(f"{form} PointCloud with pose", foxglove(form, posed)),
        MessageForm(f"{form} FrameTransform", foxglove(form, same, one_transform_a_message=True)),
    )
)

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding import CloudDecoder, Decoders, RepairingDecoder
from auditor.recordings.decoding.clouds import check_unit, finite
from auditor.recordings.decoding.kitti import SCAN
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker

OLD = schemas.POINT_CLOUD_OLD
MAKER = MessageMaker("cdr")
XYZ = np.random.default_rng(3).normal(0, 10, (30, 3)).astype(np.float32)


def decoder() -> CloudDecoder:
    found = Decoders(lambda schema: Definition("ros2msg", MAKER.definition(schema).encode())).cloud(
        schemas.POINT_CLOUD, "cdr"
    )
    assert found is not None
    return found


def field(name: str, offset: int, datatype: int = 7, count: int = 1) -> object:
    return MAKER.store.types["sensor_msgs/msg/PointField"](name=name, offset=offset, datatype=datatype, count=count)


def message(data: np.ndarray, fields: list[object], point_step: int, **given: object) -> Message:
    count = data.size // point_step if point_step else 30
    cloud = MAKER.store.types[schemas.POINT_CLOUD](
        **{
            "header": MAKER.header(5, "top"),
            "height": 1,
            "width": count,
            "fields": fields,
            "is_bigendian": False,
            "point_step": point_step,
            "row_step": count * point_step,
            "data": np.ascontiguousarray(data).view(np.uint8).reshape(-1),
            "is_dense": True,
            **given,
        }
    )
    return Message("/a", schemas.POINT_CLOUD, "cdr", 9, MAKER.serialise(schemas.POINT_CLOUD, cloud))


def xyz_fields(step: int = 4, datatype: int = 7) -> list[object]:
    return [field(name, step * place, datatype) for place, name in enumerate("xyz")]


def plain() -> Message:
    return message(XYZ.view(np.uint8), xyz_fields(), 12)


def test_points_come_out_as_recorded() -> None:
    assert np.array_equal(decoder().xyz_m(plain()), XYZ)
    assert decoder().xyz_m(plain()).dtype == np.float32


def test_fields_are_found_by_name_in_any_order_among_others_with_padding() -> None:
    points = np.zeros(
        30,
        np.dtype(
            {
                "names": ["t", "z", "x", "ring", "y"],
                "formats": ["<f8", "<f4", "<f4", "<u2", "<f4"],
                "offsets": [0, 8, 12, 17, 20],
                "itemsize": 31,
            }
        ),
    )
    for place, name in enumerate("xyz"):
        points[name] = XYZ[:, place]
    fields = [field("ring", 17, 4), field("y", 20), field("x", 12), field("z", 8), field("t", 0, 8)]
    assert np.array_equal(decoder().xyz_m(message(points.view(np.uint8), fields, 31)), XYZ)


def test_points_of_64_bits_are_converted() -> None:
    values = np.arange(90.0).reshape(30, 3)
    cloud = message(values.view(np.uint8), xyz_fields(8, 8), 24)
    assert np.array_equal(decoder().xyz_m(cloud), np.arange(90).reshape(30, 3))


@pytest.mark.parametrize(("datatype", "name"), [(3, "int16"), (5, "int32"), (2, "uint8")])
def test_whole_numbers_are_of_no_stated_unit_and_not_read(datatype: int, name: str) -> None:
    values = np.arange(90).astype(name).reshape(30, 3)
    cloud = message(values.view(np.uint8), xyz_fields(values.itemsize, datatype), 3 * values.itemsize)
    with pytest.raises(DecodingError, match=rf"whole numbers \({name}\).*does not say of which unit"):
        decoder().xyz_m(cloud)


@pytest.mark.parametrize(("scale", "metres"), [(1.0, True), (1000.0, False), (100.0, False), (0.001, False)])
def test_ranges_of_no_lidar_are_not_metres(scale: float, metres: bool) -> None:
    ranges_m = np.random.default_rng(1).gamma(2, 5, 500)[:, None] + 1
    xyz = (np.array([0.6, 0.8, 0.0]) * ranges_m * scale).astype(np.float32)
    with_zeros = np.concatenate([xyz, np.zeros((2000, 3), np.float32)])
    if metres:
        check_unit(with_zeros)
    else:
        with pytest.raises(DecodingError, match="not metres"):
            check_unit(with_zeros)


def test_big_endian_points_are_turned() -> None:
    assert np.array_equal(
        decoder().xyz_m(message(XYZ.astype(">f4").view(np.uint8), xyz_fields(), 12, is_bigendian=True)), XYZ
    )


def test_points_that_are_not_finite_are_dropped() -> None:
    points = XYZ.copy()
    points[3, 1], points[7, 2], points[9, 0] = np.nan, np.inf, -np.inf
    cloud = message(points.view(np.uint8), xyz_fields(), 12)
    assert np.array_equal(decoder().xyz_m(cloud), np.delete(XYZ, [3, 7, 9], 0))


def test_an_organised_cloud_with_padded_rows_is_read() -> None:
    rows = np.zeros((5, 80), np.uint8)
    rows[:, :72] = XYZ.view(np.uint8).reshape(5, 72)
    assert np.array_equal(decoder().xyz_m(message(rows, xyz_fields(), 12, height=5, width=6, row_step=80)), XYZ)


def test_an_empty_cloud_has_no_points() -> None:
    assert decoder().xyz_m(message(np.empty(0, np.uint8), xyz_fields(), 12)).shape == (0, 3)


@pytest.mark.parametrize(
    "given_fields",
    [
        {"point_step": 0, "row_step": 7},
        {"point_step": 0, "width": 0, "row_step": 0, "data": np.empty(0, np.uint8)},
        {"point_step": 11},
        {"width": 31, "row_step": 31 * 12},
        {"width": 60, "point_step": 24, "row_step": 720, "fields": xyz_fields()},
        {"width": 20, "point_step": 24, "row_step": 360},
        {"height": 2, "row_step": 0},
        {"fields": [field(name, 0) for name in "xyz"], "point_step": 16, "width": 22, "row_step": 352},
        {"height": 2**31, "width": 2**31},
        {"fields": []},
        {"fields": [field("x", 0), field("y", 4)]},
        {"fields": [field("x", 0), field("y", 4), field("z", 9)]},
        {"fields": [field("x", 0), field("y", 4), field("z", 2**32 - 1)]},
        {"fields": [field("x", 0), field("y", 4), field("z", 8, 99)]},
    ],
)
def test_a_cloud_that_does_not_hold_what_it_declares_is_damaged(given_fields: dict[str, object]) -> None:
    settings_of = {"fields": xyz_fields(), "point_step": 12, **given_fields}
    cloud = message(settings_of.pop("data", XYZ.view(np.uint8)), **settings_of)
    with pytest.raises(DecodingError):
        decoder().xyz_m(cloud)


def all_at_0() -> list[object]:
    return [field(name, 0) for name in "xyz"]


@pytest.mark.parametrize(
    ("given_fields", "repair"),
    [
        ({"row_step": 0, "height": 5, "width": 6}, "row_step"),
        ({"row_step": 999, "height": 5, "width": 6}, "row_step"),
        ({"row_step": 6, "height": 5, "width": 6}, "row_step"),
        ({"width": 31}, "width"),
        ({"width": 0}, "width"),
        ({"width": 2**32 - 1}, "width"),
        ({"width": 700, "height": 5, "row_step": 72}, "width"),
        ({"height": 0}, "height"),
        ({"height": 64}, "height"),
        ({"height": 2**31, "width": 6, "row_step": 72}, "height"),
        ({"point_step": 0}, "point_step"),
        ({"point_step": 0, "row_step": 0}, "point_step"),
        ({"point_step": 5000, "row_step": 360}, "point_step"),
        ({"fields": [field(name, 4 * place, 7, 30) for place, name in enumerate("xyz")]}, "count"),
        ({"fields": [field(name, 4 * place, 7, 2) for place, name in enumerate("xyz")]}, "count"),
        ({"fields": [field("z", 8, 7, 2), *xyz_fields()[:2]]}, "count"),
        ({"fields": all_at_0()}, "offset"),
    ],
)
def test_a_header_that_contradicts_the_data_is_put_right_where_they_leave_one_reading(
    given_fields: dict[str, object], repair: str
) -> None:
    used = decoder()
    cloud = message(XYZ.view(np.uint8), **{"fields": xyz_fields(), "point_step": 12, "width": 30, **given_fields})
    assert np.array_equal(used.xyz_m(cloud), XYZ)
    assert isinstance(used, RepairingDecoder)
    [said] = used.repairs
    assert said.startswith("/a: ")
    assert repair in said


@pytest.mark.parametrize(
    "given_fields",
    [
        {},
        {"fields": [field(name, 4 * place, 7, 0) for place, name in enumerate("xyz")]},
        {"row_step": 0},
        {"fields": [field(name.upper(), 4 * place) for place, name in enumerate("xyz")]},
    ],
)
def test_a_header_that_fits_is_not_said_to_be_put_right(given_fields: dict[str, object]) -> None:
    used = decoder()
    cloud = message(XYZ.view(np.uint8), **{"fields": xyz_fields(), "point_step": 12, **given_fields})
    assert np.array_equal(used.xyz_m(cloud), XYZ)
    assert isinstance(used, RepairingDecoder)
    assert not used.repairs


@pytest.mark.parametrize(("order", "flag"), [("<", True), (">", False)])
@pytest.mark.parametrize("width", [4, 8])
def test_a_byte_order_that_is_declared_wrong_is_put_right(order: str, flag: bool, width: int) -> None:
    used, datatype = decoder(), {4: 7, 8: 8}[width]
    xyz = XYZ.copy()
    xyz[3], xyz[5, 2], xyz[7] = np.nan, np.inf, 0
    written = xyz.astype(f"{order}f{width}").view(np.uint8)
    cloud = message(written, fields=xyz_fields(width, datatype), point_step=3 * width, is_bigendian=flag)
    assert np.array_equal(used.xyz_m(cloud), np.delete(xyz, [3, 5], axis=0))
    assert isinstance(used, RepairingDecoder)
    [said] = used.repairs
    assert "byte order" in said


@pytest.mark.parametrize("big", [False, True])
def test_numbers_that_are_distances_in_neither_order_are_refused(big: bool) -> None:
    """Angles in ticks, said to be floats: as floats they are next to 0."""
    ticks = np.random.default_rng(1).integers(0, 36_000, (60, 3), np.uint32)
    cloud = message(ticks.view(np.uint8), fields=xyz_fields(), point_step=12, is_bigendian=big)
    with pytest.raises(DecodingError, match="no distances"):
        decoder().xyz_m(cloud)


def test_coordinates_that_are_0_or_rounding_are_distances() -> None:
    """A scanner of one row that was turned: z is 0 but for rounding."""
    row = XYZ.copy()
    row[:, 2] = 1e-17
    assert np.array_equal(decoder().xyz_m(message(row.view(np.uint8), xyz_fields(), 12)), row)
    nothing = np.zeros_like(row)
    assert np.array_equal(decoder().xyz_m(message(nothing.view(np.uint8), xyz_fields(), 12)), nothing)


def test_padded_rows_are_not_taken_for_a_wrong_row_step() -> None:
    rows = np.zeros((5, 100), np.uint8)
    rows[:, :72] = XYZ.view(np.uint8).reshape(5, 72)
    cloud = message(rows, fields=xyz_fields(), point_step=12, height=5, width=6, row_step=100)
    assert np.array_equal(decoder().xyz_m(cloud), XYZ)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.data())
def test_a_cut_point_cloud_is_damaged_not_used(data: st.DataObject) -> None:
    whole = plain().data
    cut = Message("/a", schemas.POINT_CLOUD, "cdr", 9, whole[: data.draw(st.integers(0, len(whole) - 4))])
    with pytest.raises(DecodingError):
        decoder().xyz_m(cut)


@settings(max_examples=70, deadline=None, derandomize=True)
@given(st.data())
def test_noise_in_a_point_cloud_raises_only_our_own_error(data: st.DataObject) -> None:
    noisy = bytearray(plain().data)
    for _ in range(data.draw(st.integers(1, 6))):
        noisy[data.draw(st.integers(0, 160))] = data.draw(st.integers(0, 255))
    with suppress(DecodingError):
        decoder().xyz_m(Message("/a", schemas.POINT_CLOUD, "cdr", 9, bytes(noisy)))


def test_a_kitti_scan_cut_inside_a_point_is_damaged() -> None:
    found = Decoders(lambda _: None).cloud(SCAN, "bin")
    assert found is not None
    points = np.hstack([XYZ, np.ones((30, 1), np.float32)]).tobytes()
    assert np.array_equal(found.xyz_m(Message("/a", SCAN, "bin", 9, points)), XYZ)
    for data in (points[:-1], b""):
        with pytest.raises(DecodingError):
            found.xyz_m(Message("/a", SCAN, "bin", 9, data))


def test_points_of_opposite_infinity_are_dropped_silently() -> None:
    points = XYZ.copy()
    points[3] = np.inf, -np.inf, 0
    assert len(decoder().xyz_m(message(points.view(np.uint8), xyz_fields(), 12))) == 29


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 3e38, 1e25, -1e10])
def test_points_beyond_any_world_count_as_no_return(value: float) -> None:
    """Their squares overflow wherever a range is computed."""
    points = np.array([[1, 2, 3], [value, 1, 1], [1, -value, value], [4, 5, 6]], np.float32)
    assert finite(points).tolist() == [[1, 2, 3], [4, 5, 6]]
    assert len(finite(points[1:3])) == 0


def old_message(encoding: str, count: int | None = None) -> tuple[Message, CloudDecoder]:
    """A sensor_msgs/PointCloud with the points XYZ, and its decoder."""
    maker = MessageMaker(encoding)
    point = maker.store.types["geometry_msgs/msg/Point32"]
    points = [point(*map(float, one)) for one in XYZ]
    cloud = maker.store.types[OLD](header=maker.header(5, "velo"), points=points, channels=[])
    data = maker.serialise(OLD, cloud)
    if count is not None:
        data = data.replace(len(XYZ).to_bytes(4, "little"), count.to_bytes(4, "little"))
    text = maker.definition(OLD).encode()
    form = "ros1msg" if encoding == "ros1" else "ros2msg"
    found = Decoders(lambda _: Definition(form, text)).cloud(OLD, encoding)
    assert found is not None
    return Message("/old", OLD, encoding, 9, data), found


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_points_of_the_old_type_come_out_as_recorded(encoding: str) -> None:
    old, found = old_message(encoding)
    assert np.array_equal(found.xyz_m(old), XYZ)
    assert found.header(old).stamp_ns == 5


@pytest.mark.parametrize("count", [31, 2**31])
def test_a_cloud_of_the_old_type_that_holds_fewer_points_than_it_declares_is_damaged(count: int) -> None:
    old, found = old_message("cdr", count)
    with pytest.raises(DecodingError, match=f"declares {count} points"):
        found.xyz_m(old)


@settings(max_examples=50)
@given(data=st.data())
def test_a_cut_cloud_of_the_old_type_is_damaged_not_used(data: st.DataObject) -> None:
    old, found = old_message("cdr")
    cut = data.draw(st.integers(0, len(XYZ) * 12))
    with pytest.raises(DecodingError):
        found.xyz_m(Message("/old", OLD, "cdr", 9, old.data[:cut]))

"""Packets of an HDL-64E, whose angles stand in the packets themselves, a byte in each."""

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from auditor.errors import DecodingError
from auditor.recordings import open_recording, schemas, survey
from auditor.recordings.decoding import Decoders
from auditor.recordings.decoding.points.velodyne import calibration_of, names_no_model
from tests.making.velodyne import packets_of_hdl_64e, scan_of, velodyne_scan

pytest.importorskip("velodyne_decoder")

PACKETS = packets_of_hdl_64e()
SCAN = 348


def test_the_angles_are_found_wherever_the_text_begins() -> None:
    whole = calibration_of(PACKETS)
    assert whole is not None
    assert calibration_of(PACKETS[1000:] + PACKETS[:1500]) == whole


@pytest.mark.parametrize("packets", [[], PACKETS[:1000], [bytes(1206)] * 4000])
def test_no_angles_are_found_where_none_are(packets: list[bytes]) -> None:
    assert calibration_of(packets) is None


def test_other_models_name_themselves() -> None:
    assert names_no_model(PACKETS)
    assert not names_no_model([bytes(1204) + b"\x37\x22"] * 9)


def test_points_have_the_angles_of_the_text() -> None:
    text = calibration_of(PACKETS)
    assert text is not None
    reading = Decoders(lambda _: None, metadata={"/packets": text}).cloud(schemas.VELODYNE, "cdr")
    assert reading is not None
    xyz_m = reading.xyz_m(scan_of(PACKETS[:SCAN]))
    # A distance of 10 m, and lasers 0.2 m above the middle that look from 2 to -23.2 degrees.
    assert np.linalg.norm(xyz_m, axis=1) == pytest.approx(10.0, abs=0.1)
    down = np.degrees(np.arcsin((xyz_m[:, 2] - 0.2) / 10))
    assert (down.max(), down.min()) == pytest.approx((2.0, 2.0 - 63 * 0.4), abs=0.2)


def write(path: Path, packets: list[bytes]) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channel = writer.register_channel("/packets", "cdr", writer.register_schema(schemas.VELODYNE, "ros2msg", b""))
        for number in range(0, len(packets), SCAN):
            data = scan_of(packets[number : number + SCAN]).data
            writer.add_message(channel, 7 * 10**9 + number * 10**8, data, 1)
        writer.finish()
    return path


def test_a_recording_of_two_seconds_is_read_and_a_shorter_one_said(tmp_path: Path) -> None:
    for name, packets, read in (("a.mcap", PACKETS, True), ("b.mcap", PACKETS[: 2 * SCAN], False)):
        with open_recording(write(tmp_path / name, packets)) as recording:
            found = survey(recording)
        assert bool(found.clouds) is read
        assert [one.reason for one in found.unreadable] == (
            [] if read else ["its packets are of several models, or of an HDL-64E without its calibration"]
        )


def test_a_velodyne_that_names_its_model_needs_no_angles() -> None:
    reading = Decoders(lambda _: None).cloud(schemas.VELODYNE, "cdr")
    assert reading is not None
    assert len(reading.xyz_m(velodyne_scan(76)))
    with pytest.raises(DecodingError, match="HDL-64E"):
        reading.xyz_m(scan_of(PACKETS[:SCAN]))

"""A measurement keeps where the vehicle was, and nothing of that changes what is counted."""

from math import nan
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.model.frames import Pose
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from auditor.recordings.synchronisation import poses
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_sql
from auditor.store.store import Store
from auditor.store.tables import read_rows
from tests.making.reading_all import count_reads
from tests.making.scenes import plane_rig
from tests.making.small_drives import FOUR_CAMERAS, PERIOD_NS, START_NS, drive_frames

FRAMES = 3
FORMS = {
    "none": None,
    "fixes": lambda stamp_ns: Pose("gps", 49.0 + (stamp_ns - START_NS) / 1e9, 8.4, 115.0),
    "bad": lambda _: Pose("gps", nan, 8.4, 115.0),
}
"""The same drive without a GPS, with one, and with one that gives nothing but bad numbers."""


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Store]:
    rig = plane_rig(FOUR_CAMERAS[1:], True)
    found = {}
    for name, place in FORMS.items():
        folder = tmp_path_factory.mktemp(name)
        write_mcap(folder / "drive.mcap", rig, drive_frames(rig, FRAMES), place=place)
        measure_recording(MeasureTask(folder / "drive.mcap", folder / "audit"), lambda *_: None)
        found[name] = Store.open(folder / "audit")
    return found


def counted(store: Store, table: str) -> list[dict[str, object]]:
    [measurement] = store.measurements()
    rows = read_rows(table, store.path(table, measurement.measurement_id))
    return [{name: value for name, value in row.items() if name != "measurement_id"} for row in rows]


@pytest.mark.parametrize("table", ["frames", "cells", "fault_features", "regions"])
def test_poses_change_no_count(stores: dict[str, Store], table: str) -> None:
    assert counted(stores["none"], table) == counted(stores["fixes"], table) == counted(stores["bad"], table)


def test_every_measured_frame_has_a_place_with_the_names_of_its_recording(stores: dict[str, Store]) -> None:
    answer = run_sql(
        stores["fixes"],
        "SELECT name, frame, stamp_ns, offset_ns, topic, latitude_deg, x_m, heading_deg FROM poses ORDER BY frame",
    )
    expected = [
        {
            "name": "drive.mcap",
            "frame": frame,
            "stamp_ns": START_NS + frame * PERIOD_NS,
            "offset_ns": 0,
            "topic": "/gps/fix",
            "latitude_deg": pytest.approx(49.0 + frame / 10),
            "x_m": None,
            "heading_deg": None,
        }
        for frame in range(FRAMES)
    ]
    assert answer.to_pylist() == expected
    assert verify(stores["fixes"]).problems == ()


def test_what_became_of_the_messages_is_kept_and_bad_ones_are_no_damage_of_the_recording(
    stores: dict[str, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    sql = "SELECT damage, unnest(pose_topics, recursive := true) FROM measurements"
    kept = {name: run_sql(store, sql).to_pylist() for name, store in stores.items()}
    assert kept["none"] == []
    [fixes], [bad] = kept["fixes"], kept["bad"]
    assert (fixes["damage"], fixes["read"], fixes["frames"]) == ([], FRAMES, FRAMES)
    assert (bad["damage"], bad["read"], bad["frames"]) == ([], FRAMES, 0)
    assert dict(bad["dropped"]) == {"not finite or out of range": FRAMES}
    codes = {name: run(["judge", str(store.folder)]) for name, store in stores.items()}
    assert codes["bad"] == codes["none"]
    assert "damaged" not in capsys.readouterr().err


def test_a_removed_recording_leaves_no_pose(stores: dict[str, Store]) -> None:
    [recording] = stores["bad"].ids("recordings")
    assert run(["store", "remove", recording, "--yes", "--store", str(stores["bad"].folder)]) == 0
    assert not list(stores["bad"].folder.glob("poses/*.parquet"))


def test_places_are_the_same_where_their_messages_are_many_and_are_read_again(
    stores: dict[str, Store], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = count_reads(monkeypatch)
    rig = plane_rig(FOUR_CAMERAS[1:], True)
    write_mcap(tmp_path / "drive.mcap", rig, drive_frames(rig, FRAMES), place=FORMS["fixes"])
    taken = []
    for kept_bytes in (poses._MOST_KEPT_BYTES, 0):
        monkeypatch.setattr(poses, "_MOST_KEPT_BYTES", kept_bytes)
        audit = tmp_path / f"audit-{kept_bytes}"
        read.clear()
        measure_recording(MeasureTask(tmp_path / "drive.mcap", audit), lambda *_: None)
        taken.append(sum(read))
        assert counted(Store.open(audit), "poses") == counted(stores["fixes"], "poses")
    assert taken[0] < taken[1]

"""A recording of several rigs, as that of a ring of cameras is, is read once for all of them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureResult, MeasureTask
from auditor.recordings.synchronisation import streams
from tests.making.published_recordings import road_points, write_published
from tests.making.published_rigs import PUBLISHED_RIGS
from tests.making.reading_all import count_reads

RIG = PUBLISHED_RIGS["nuscenes"].smaller(0.15)
FRAMES = 6
CHANGES_BY_ITSELF = {"measured_at", "seconds", "sightings"}


def drive(folder: Path, lasts: Mapping[str, int] | None = None) -> Path:
    """Frames of noise, in which a camera may end early."""
    rng = np.random.default_rng(0)
    pictures = [
        {c.name: rng.integers(0, 256, c.size_px[::-1]).astype(np.uint8) for c in RIG.cameras} for _ in range(FRAMES)
    ]
    clouds = [{lidar.name: road_points(lidar) for lidar in RIG.lidars}] * FRAMES
    return write_published(folder / "ring.mcap", RIG, pictures, clouds, lasts or {})


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drive(tmp_path_factory.mktemp("ring"))


def measured(path: Path, store: Path) -> MeasureResult:
    return measure_recording(MeasureTask(path, store), lambda _, __: None)


def kept(store: Path) -> Mapping[str, Any]:
    """What a store holds of measurements, but for times."""
    found = {}
    for path in sorted(store.rglob("*.parquet")):
        table = pq.read_table(path)
        rows = table.drop_columns([name for name in table.column_names if name in CHANGES_BY_ITSELF]).to_pylist()
        found[str(path.relative_to(store))] = repr(rows)
    return found


def apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on no message may wait for a stream that is behind."""
    monkeypatch.setattr(streams, "MOST_WAITING_BYTES", 0)


def test_six_cameras_take_one_read_and_give_what_six_reads_do(
    ring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = count_reads(monkeypatch)
    together = measured(ring, tmp_path / "together")
    size, once = ring.stat().st_size, sum(read)
    assert (len(together.measurement_ids), together.frames) == (len(RIG.cameras), FRAMES * len(RIG.cameras))
    read.clear()
    apart(monkeypatch)
    assert measured(ring, tmp_path / "apart").measurement_ids == together.measurement_ids
    assert sum(read) > once + (len(RIG.cameras) - 1) * size
    assert kept(tmp_path / "together") == kept(tmp_path / "apart")


def test_what_is_damaged_is_told_of_each_camera_as_by_a_read_of_its_own(
    ring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = ring.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    together = measured(cut, tmp_path / "together")
    assert together.damage
    apart(monkeypatch)
    measured(cut, tmp_path / "apart")
    assert kept(tmp_path / "together") == kept(tmp_path / "apart")


def test_a_camera_that_ends_early_leaves_the_others_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    early = RIG.cameras[2].name
    path = drive(tmp_path, lasts={camera.name: 3 if camera.name == early else FRAMES for camera in RIG.cameras})
    measured(path, tmp_path / "together")
    apart(monkeypatch)
    measured(path, tmp_path / "apart")
    assert kept(tmp_path / "together") == kept(tmp_path / "apart")

"""Every container and every message form, one row each: the same drive gives the same frames and the same counts.

Forms that lose something (JPEG, videos, mosaics, halved chroma) give the same frames, and every E within 0.02.
`python -m pytest tests/recordings/test_message_forms.py -s` prints the table.
"""

from pathlib import Path

import numpy as np
import pytest

from auditor.measurement import measure
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher
from auditor.model.frames import Frame, SensorState
from auditor.model.measurement import Counts, Statistic
from auditor.model.rig import Rig
from tests.making.forms import CONTAINERS
from tests.making.message_forms import FORMS, FOXGLOVE_FORMS, MessageForm, drive, through_container
from tests.making.reading_all import frames_of
from tests.making.scenes import plane_rig

MOST_OFF = 0.04  # equalising before matching moves a level by one where its share changes a little
RIG = plane_rig((0.6, 0.3, 0.0))
FRAMES = drive(RIG, 2)
MATCHER = find_matcher("sgbm", MatcherOptions())
ROWS = (
    *(MessageForm(c.name, through_container(c.write)) for c in CONTAINERS),
    *FORMS,
    *FOXGLOVE_FORMS,
)


Counted = list[tuple[Counts | None, ...]]


def read(path: Path) -> tuple[Rig, list[Frame]]:
    """The rig and the frames of a recording; all it read is accounted for."""
    rig, frames, stream = frames_of(path)
    assert {topic.read for topic in stream.balance if topic.sensor is not None} == {len(FRAMES)}
    return rig, frames


def counts_of(rig: Rig, frames: list[Frame]) -> Counted:
    return [measure(frame, rig, MATCHER)[0].counts for frame in frames]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, list[Frame], Counted]:
    plain = next(container for container in CONTAINERS if container.name == "mcap ros2")
    rig, frames = read(plain.write(tmp_path_factory.mktemp("plain"), RIG, FRAMES, "raw"))
    return rig, frames, counts_of(rig, frames)


def test_the_plain_form_has_what_was_written(expected) -> None:
    _, frames, counts = expected
    assert [frame.stamp_ns for frame in frames] == [frame.stamp_ns for frame in FRAMES]
    E = [[c.disparity_error(Statistic.PLAIN) for c in of_frame] for of_frame in counts]
    assert max(E[0]) < 0.1
    assert max(E[1]) > 0.3, "the last frame is attacked: a form that hid it would be noticed"


def geometry(rig: Rig) -> tuple[object, ...]:
    cameras = [(one.width_px, one.height_px, one.projection.tolist(), one.lens) for one in rig.cameras]
    return rig.lidar and rig.lidar.rig_SE3_lidar.tolist(), cameras


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_every_form_gives_the_same_frames_and_counts(row: MessageForm, expected, tmp_path: Path) -> None:
    if not row.is_there:
        pytest.skip("its extra is not installed")
    rig, frames = read(row.write(tmp_path, RIG, FRAMES))
    plain, before, counted = expected
    assert [(frame.number, frame.stamp_ns) for frame in frames] == [(f.number, f.stamp_ns) for f in before]
    for frame, other in zip(frames, before, strict=True):
        assert all(there.state is SensorState.PRESENT for there in frame.presence.values())
        assert np.abs(frame.cloud.xyz_m - other.cloud.xyz_m).max() < 0.01
        if row.lossless:
            assert np.array_equal(frame.cloud.xyz_m, other.cloud.xyz_m)
            assert all(np.array_equal(i.pixels, other.images[n].pixels) for n, i in frame.images.items())
    if row.lossless and geometry(rig) == geometry(plain):
        return  # the same pixels and points in the same places give the same counts
    counts = counts_of(rig, frames)
    off = max(
        abs(a.disparity_error(statistic) - b.disparity_error(statistic))
        for ours, theirs in zip(counts, counted, strict=True)
        for a, b in zip(ours, theirs, strict=True)
        for statistic in Statistic
    )
    print(f"{row.name:55} {'same counts' if counts == counted else f'E off by at most {off:.4f}'}")
    assert counts == counted if row.lossless else off <= MOST_OFF

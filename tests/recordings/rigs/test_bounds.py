"""However many cameras a recording has, few are compared, and those that are not are named."""

from pathlib import Path

import numpy as np
import pytest

from auditor.errors import RigError
from auditor.model.optics.geometry import motion
from auditor.model.rig import Camera, Rig
from auditor.recordings import check_rig, find_rigs, rig_of_yaml, search_rigs
from auditor.recordings.decoding import Transform
from auditor.recordings.parameters import RIG_LIMITS
from auditor.recordings.rigs import discovery, extrinsics
from auditor.recordings.rigs.cameras import MOST_CANDIDATES
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.left_out import Reason, first_ones, overlapping_most
from auditor.recordings.synchronisation.survey import Survey
from tests.making.recorded_drives import make_rig
from tests.recordings.rigs.test_camchain import camchain
from tests.recordings.rigs.test_discovery import K, P, at, info, look, turned

BENT = (-0.05, 0.01, 0.0, 0.0)


def in_a_row(count: int, *, rectified: bool = True, off_line: bool = False, called: str = "c{:03}") -> Survey:
    names = [called.format(number) for number in range(count)]
    infos = {name: info(name, P(0), distortion=() if rectified else BENT) for name in names}
    places = {name: at(0.1 * number, 0.1 * (number % 2) if off_line else 0.0) for number, name in enumerate(names)}
    return look(infos, {**places, "top": at(0)}, images="image_rect" if rectified else "image_raw")


@pytest.mark.parametrize("rectified", [True, False])
@pytest.mark.parametrize("off_line", [True, False])
def test_a_rig_of_many_cameras_has_those_that_overlap_most(rectified: bool, off_line: bool) -> None:
    found = search_rigs(in_a_row(24, rectified=rectified, off_line=off_line))
    rig = found.rigs[0]
    assert rig.n == RIG_LIMITS.most_cameras
    kept = {int(camera.name[1:]) for camera in rig.cameras}
    # Of cameras in a row those beside each other overlap most.
    assert max(kept) - min(kept) < (2 if off_line else 1) * RIG_LIMITS.most_cameras
    [cut] = [reason for reason in found.reasons if "at most 9 are compared" in reason]
    assert not any(f"c{number:03}" in cut for number in kept)
    others = {int(one.camera(1).name[1:]) for one in found.rigs[1:] if one.by_time}
    assert others == {*range(24)} - kept, "each of the others is audited by its own past"


def test_a_camera_that_is_named_as_a_sentence_begins_hides_no_reason() -> None:
    found = search_rigs(in_a_row(10, called="1{}"))
    assert any(reason.startswith("10 cameras look the same way") for reason in found.reasons), found


def test_a_rig_of_nine_cameras_is_whole() -> None:
    found = search_rigs(in_a_row(RIG_LIMITS.most_cameras))
    assert [rig.n for rig in found.rigs] == [RIG_LIMITS.most_cameras]
    assert not found.reasons


@pytest.mark.parametrize("off_line", [True, False])
def test_the_search_does_not_work_more_for_more_cameras_than_a_rig_has(
    monkeypatch: pytest.MonkeyPatch,
    off_line: bool,
) -> None:
    views: list[int] = []
    usual = extrinsics.common_view

    def counted(rig: Rig, *, widest: bool = False, cell_px: int = 8) -> object:
        views.append(rig.n)
        return usual(rig, widest=widest, cell_px=cell_px)

    monkeypatch.setattr(extrinsics, "common_view", counted)
    made = []
    for count in (12, 120):
        views.clear()
        assert find_rigs(in_a_row(count, rectified=False, off_line=off_line))
        made.append(len(views))
    assert made[0] == made[1] < 100


def test_cameras_beyond_those_that_are_looked_at_are_named() -> None:
    reasons: list[Reason] = []
    assert first_ones([1, 2, 3, 4], 2, "numbers are there", ["one", "two", "three", "four"], reasons) == [1, 2]
    [reason] = reasons
    assert str(reason) == "4 numbers are there, and at most 2 are looked at. Left out: three, four"
    assert reason.tells_of("/four/image", "four")
    assert not reason.tells_of("/two/image", "two")
    found = search_rigs(in_a_row(MOST_CANDIDATES + 1))
    assert any(reason.endswith("Left out: c200") for reason in found.reasons)


def test_rigs_beyond_those_that_are_measured_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("front1", "front2", "front3", "rear1", "rear2")
    infos = {name: info(name, P(0)) for name in names}
    places = {name: turned(180 if "rear" in name else 0, at(0.3 * number)) for number, name in enumerate(names)}
    surveyed = look(infos, {**places, "top": at(0)})
    assert [rig.n for rig in search_rigs(surveyed).rigs] == [3, 2]
    monkeypatch.setattr(discovery, "_MOST_RIGS", 1)
    found = search_rigs(surveyed)
    assert [rig.n for rig in found.rigs] == [3]
    assert any(reason.endswith("Left out: the one of rear1, rear2") for reason in found.reasons)


def test_footprints_decide_which_cameras_overlap_most() -> None:
    def camera(name: str, x: float, degrees: float = 0.0) -> Camera:
        turn = turned(degrees, np.eye(4))[:3, :3].T
        seen_from = np.column_stack([np.eye(3), -np.array([x, 0, 0])])
        return Camera(0, name, f"/{name}", 640, 480, K @ turn @ seen_from, rectified=False)

    cameras = [camera("far", 9), camera("a", 0), camera("turned", 0.1, 18), camera("b", 0.3), camera("c", 0.6)]
    reasons: list[Reason] = []
    assert [one.name for one in overlapping_most(cameras, reasons, most=3)] == ["a", "b", "c"]
    [reason] = reasons
    assert str(reason).endswith("Left out: far, turned")


def test_a_rig_file_of_too_many_cameras_is_refused() -> None:
    rig = find_rigs(in_a_row(RIG_LIMITS.most_cameras))[0]
    last = rig.cameras[-1]
    more = Camera(rig.n + 1, "more", "/more", last.width_px, last.height_px, P(-5))
    with pytest.raises(RigError, match="the rig has 10 cameras, and at most 9 are compared"):
        check_rig(Rig(rig.lidar, (*rig.cameras, more)), in_a_row(24))


def test_frames_are_connected_by_long_chains_and_through_cycles() -> None:
    step = motion(np.eye(3), np.array([0.001, 0, 0]))
    chained = [Transform(f"link{number}", f"link{number + 1}", step) for number in range(5000)]
    tree = FrameTree([*chained, Transform("link5000", "link4990", np.eye(4)), Transform("a", "a", step)])
    found = tree.between("link0", "link4000")
    assert found is not None
    np.testing.assert_allclose(found[:3, 3], [4, 0, 0])
    assert tree.between("link0", "nowhere") is None
    assert tree.between("a", "a") is not None


def test_a_camchain_of_too_many_cameras_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(camchain(make_rig(10)))
    with pytest.raises(RigError, match="10 cameras"):
        rig_of_yaml(path, in_a_row(3))

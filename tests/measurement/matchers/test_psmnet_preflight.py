import numpy as np
import pytest

torch = pytest.importorskip("torch")

from auditor.measurement.disparity.matchers import SgbmMatcher, preflight  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.matcher import PsmnetMatcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.network import PSMNet  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.preflight import (  # noqa: E402
    Cost,
    check_precision,
    check_scale,
    first_frames_warnings,
)
from auditor.measurement.disparity.matchers.psmnet.weights import Weights, content_sha256  # noqa: E402
from tests.making.psmnet_networks import noise, ruled_state  # noqa: E402
from tests.making.scenes import plane_frame, plane_rig  # noqa: E402


def disparities_of(levels: np.ndarray, align_corners: bool, max_disparity: int = 192) -> np.ndarray:
    """What the network's own soft argmin makes of costs with a sharp peak at these levels of the quarter scale."""
    network = PSMNet(max_disparity=max_disparity, align_corners=align_corners, width=1)
    level = torch.arange(max_disparity // 4).view(1, 1, -1, 1, 1)
    cost = -200.0 * (level - torch.from_numpy(levels).view(1, 1, 1, 1, -1)).abs()
    return network.disparity(cost, (1, levels.size))[0, 0].numpy()


LEVELS = np.repeat(np.linspace(2, 30, 29), 20)  # 8 to 120 px, whole levels


def lidar(seed: int, disparity: np.ndarray) -> np.ndarray:
    """The true disparities with a LiDAR's noise, one in ten far off, some unknown."""
    rng = np.random.default_rng(seed)
    noisy = disparity + rng.normal(0, 0.4, disparity.shape)
    noisy[rng.random(disparity.shape) < 0.1] = 20.0
    noisy[rng.random(disparity.shape) < 0.1] = np.nan
    return noisy


@pytest.mark.parametrize("trained", [True, False])
def test_the_convention_that_the_weights_were_trained_with_raises_no_warning(trained: bool) -> None:
    found = disparities_of(LEVELS, trained)
    check = check_scale([(found, lidar(0, found))], align_corners=trained, max_disparity=192)
    assert check is not None
    assert check.warning is None
    assert check.ratio == pytest.approx(1.0, abs=0.01)
    assert check.residual_px < 0.6


@pytest.mark.parametrize("trained", [True, False])
def test_the_other_convention_is_noticed_and_named(trained: bool) -> None:
    truth, found = disparities_of(LEVELS, trained), disparities_of(LEVELS, not trained)
    check = check_scale([(found, lidar(0, truth))], align_corners=not trained, max_disparity=192)
    assert check is not None
    assert check.warning is not None
    assert f"with align_corners={trained}" in check.warning
    assert check.other_residual_px < 0.6 < check.residual_px


def test_a_scale_that_no_convention_explains_is_noticed_too() -> None:
    found = disparities_of(LEVELS, True)
    check = check_scale([(found, lidar(0, found / 1.1))], align_corners=True, max_disparity=192)
    assert check is not None
    assert check.warning is not None
    assert "median 1.10" in check.warning
    assert "calibration" in check.warning


def test_at_half_resolution_the_conventions_are_told_apart_in_the_networks_pixels() -> None:
    levels = LEVELS[LEVELS < 23]
    truth = 2 * disparities_of(levels, True, 96)  # a network for 96 px of its own, 192 of the image
    pairs = [(2 * disparities_of(levels, False, 96), lidar(seed, truth)) for seed in range(2)]
    found = check_scale(pairs, align_corners=False, max_disparity=192, step=2)
    assert found.other_residual_px < 0.6 < found.residual_px
    assert "align_corners=True" in found.warning


def test_too_few_pixels_say_nothing() -> None:
    assert check_scale([], align_corners=True, max_disparity=192) is None
    assert check_scale([(np.ones(499), np.full(499, 20.0))], align_corners=True, max_disparity=192) is None
    far = np.full(1000, 3.0)
    assert check_scale([(far, far)], align_corners=True, max_disparity=192) is None


def test_a_precision_is_compared_with_fp32_on_the_same_pairs(monkeypatch) -> None:
    state = ruled_state(4)
    matcher = PsmnetMatcher(Weights(state, 4, content_sha256(state), True, 32, ""))
    images = [noise(32, 48, 1), noise(32, 48, 2)]
    same = check_precision(matcher, images, [(0, 1)])
    assert (same.mean_px, same.largest_px, same.warning) == (0.0, 0.0, None)
    whole = matcher.match_pairs
    for change, warns in ((0.05, False), (0.2, True), (np.nan, True)):
        monkeypatch.setattr(
            matcher, "match_pairs", lambda *a, change=change: [m + np.float32(change) for m in whole(*a)]
        )
        assert (check_precision(matcher, images, [(0, 1)]).warning is not None) is warns


def test_the_first_frames_are_compared_with_their_lidar(monkeypatch) -> None:
    state = ruled_state(4)
    matcher = PsmnetMatcher(Weights(state, 4, content_sha256(state), True, 64, ""))
    rig = plane_rig()
    frames = [plane_frame(rig), plane_frame(rig, without=frozenset({3})), plane_frame(rig, without=frozenset({0}))]
    matched = []

    def found(images, pairs, disparity_px=20.0):  # at 9 m between cameras 0.6 m apart
        matched.append(pairs)
        return [np.full(images[0].shape[:2], disparity_px, dtype=np.float32) for _ in pairs]

    monkeypatch.setattr(matcher, "match_pairs", found)
    assert first_frames_warnings(matcher, rig, frames) == ()
    assert matched == [[(0, 1)], [(0, 1)]]  # camera 3, the leftmost, is missing once
    monkeypatch.setattr(matcher, "match_pairs", lambda *a: found(*a, disparity_px=22.0))
    (warning,) = first_frames_warnings(matcher, rig, frames)
    assert "off scale" in warning
    assert first_frames_warnings(matcher, rig, frames[1:]) == ()  # without a LiDAR there is no warning


def test_a_lower_precision_is_checked_on_the_first_frame(monkeypatch) -> None:
    state = ruled_state(4)
    matcher = PsmnetMatcher(Weights(state, 4, content_sha256(state), True, 64, ""))
    monkeypatch.setattr(matcher, "precision", "bf16")
    monkeypatch.setattr(matcher, "match_pairs", lambda images, pairs: [np.full(images[0].shape[:2], 20, np.float32)])
    rig = plane_rig()
    (warning,) = first_frames_warnings(matcher, rig, [plane_frame(rig)])
    assert "bf16 changes PSMNet's disparities" in warning


def test_before_the_work_begins_its_cost_and_what_looks_wrong_are_told(monkeypatch) -> None:
    rig = plane_rig((0.6, 0.3, 0.0))
    state = ruled_state(4)
    matcher = PsmnetMatcher(Weights(state, 4, content_sha256(state), True, 64, ""))
    monkeypatch.setattr(
        "auditor.measurement.disparity.matchers.psmnet.preflight.frame_cost",
        lambda matcher, size: Cost(0.5, 2.0, "cuda:0", 1),
    )
    monkeypatch.setattr(
        "auditor.measurement.disparity.matchers.psmnet.preflight.first_frames_warnings",
        lambda matcher, rig, frames: (f"{len(frames)} checked",),
    )
    lines = preflight(matcher, rig, [plane_frame(rig)], 7200)
    # Three images, two pairs in the view of the leftmost, and (S_1, S_2).
    assert lines == ("psmnet on cuda:0: about 7.5 s a frame, 15.0 h for 7200 frames", "1 checked")
    assert preflight(SgbmMatcher(), rig, [plane_frame(rig)], 7200) == ()

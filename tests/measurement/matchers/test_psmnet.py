import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from auditor.errors import SettingError  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.inference import InferenceEngine, make_engine  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.matcher import PsmnetMatcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.network import PSMNet  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.preflight import frame_cost  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import Weights, content_sha256  # noqa: E402
from auditor.measurement.frame import measure, measure_stream  # noqa: E402
from tests.making.psmnet_networks import SMALL, noise, ruled_state  # noqa: E402
from tests.making.scenes import plane_frame, plane_rig  # noqa: E402

# Of json.dumps(sorted {name: shape}) of the published network.
PUBLISHED = "6214e562767122df8d1387cfb903530b40f8d377dd82a87cc3925952e539840f"


@pytest.fixture(scope="module")
def golden(real_data: Path) -> dict[str, np.ndarray]:
    """Images, and what the published network gives for them with weights by the rule, computed in float64."""
    with np.load(real_data.parent / "psmnet" / "golden.npz") as arrays:
        return dict(arrays)


def weights(width: int = 4, max_disparity: int | None = 32) -> Weights:
    state = ruled_state(width)
    return Weights(state, width, content_sha256(state), True, max_disparity, "ruled.pt")


@pytest.fixture(scope="module")
def small() -> PsmnetMatcher:
    return PsmnetMatcher(weights())


def test_names_and_shapes_are_those_of_the_published_network() -> None:
    with torch.device("meta"):
        network = PSMNet(max_disparity=192, align_corners=True)
    shapes = {name: list(tensor.shape) for name, tensor in network.state_dict().items()}
    assert len(shapes) == 514
    assert sum(parameter.numel() for parameter in network.parameters()) == 5_224_768
    assert hashlib.sha256(json.dumps(shapes, sort_keys=True).encode()).hexdigest() == PUBLISHED


def test_disparities_are_the_published_networks_in_both_conventions(golden: dict[str, np.ndarray]) -> None:
    state = ruled_state()
    for align_corners in (True, False):
        engine = make_engine(
            Weights(state, 32, "", None, None, ""),
            align_corners=align_corners,
            max_disparity=192,
            device=torch.device("cpu"),
        )
        features = engine.features([golden["left"][..., ::-1], golden["right"][..., ::-1]])
        found = engine.disparities(features[:1], features[1:], (256, 512))[0]
        expected = golden[f"disparity_align_corners_{str(align_corners).lower()}"]
        assert np.abs(found - expected).max() < 0.01
    assert np.abs(golden["disparity_align_corners_true"] - golden["disparity_align_corners_false"]).max() > 1


def test_folding_and_padding_change_no_disparity(small: PsmnetMatcher) -> None:
    network = PSMNet(max_disparity=32, align_corners=True, width=4)
    network.load_state_dict(ruled_state(4))
    left, right = noise(64, 96, 1), noise(64, 96, 2)
    mean, deviation = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    tensors = [
        torch.from_numpy(((image[..., ::-1] / 255 - mean) / deviation).transpose(2, 0, 1).copy()).float()[None]
        for image in (left, right)
    ]
    with torch.inference_mode():
        plain = network.eval()(*tensors)[2][0].numpy()
    np.testing.assert_allclose(small.match(left, right), plain, atol=1e-3)


def test_images_are_padded_with_zeros_at_the_top_and_the_right(small: PsmnetMatcher) -> None:
    loaded = small.engine.load([noise(60, 90)])
    assert loaded.shape == (1, 3, 64, 96)
    assert not loaded[:, :, :4].any()
    assert not loaded[:, :, :, 90:].any()
    assert loaded[:, :, 4:, :90].abs().min() > 0
    assert small.match(noise(60, 90, 1), noise(60, 90, 2)).shape == (60, 90)


def test_colours_are_taken_as_bgr_and_grey_as_all_three(small: PsmnetMatcher) -> None:
    blue = np.zeros((16, 16, 3), dtype=np.uint8)
    blue[..., 0] = 255
    channels = small.engine.load([blue])[0, :, 0, 0]
    assert channels.argmax() == 2
    grey = noise(64, 64)[..., 0]
    repeated = np.ascontiguousarray(grey[..., np.newaxis].repeat(3, axis=2))
    np.testing.assert_array_equal(small.match(grey, grey), small.match(repeated, repeated))


def test_every_pixel_has_a_disparity_inside_the_range_even_where_nothing_matches(small: PsmnetMatcher) -> None:
    disparity = small.match(noise(48, 80, 1), noise(48, 80, 2))
    assert disparity.dtype == np.float32
    assert np.isfinite(disparity).all()
    assert disparity.min() >= 0
    assert disparity.max() <= small.range_px - 1


def test_pairs_of_a_frame_share_the_features_of_its_images(small: PsmnetMatcher, monkeypatch) -> None:
    seen = []
    features = InferenceEngine.features

    def counted(self: InferenceEngine, images: list[np.ndarray]) -> torch.Tensor:
        seen.extend(images)
        return features(self, images)

    monkeypatch.setattr(InferenceEngine, "features", counted)
    images = [noise(48, 64, seed) for seed in range(4)]
    maps = small.match_pairs(images, [(0, 1), (0, 2), (1, 2)])
    assert [id(image) for image in seen] == [id(image) for image in images[:3]]
    for (left, right), disparity in zip([(0, 1), (0, 2), (1, 2)], maps, strict=True):
        np.testing.assert_array_equal(disparity, small.match(images[left], images[right]))


def test_images_of_several_sizes_are_matched_with_their_like(small: PsmnetMatcher) -> None:
    images = [noise(48, 64, 1), noise(32, 64, 2), noise(48, 64, 3), noise(32, 64, 4)]
    maps = small.match_pairs(images, [(0, 2), (1, 3)])
    assert [disparity.shape for disparity in maps] == [(48, 64), (32, 64)]
    with pytest.raises(SettingError, match=r"different sizes, \(48, 64\) and \(32, 64\)"):
        small.match(images[0], images[1])


def test_a_batch_that_does_not_fit_is_tried_again_with_half_as_many(monkeypatch) -> None:
    matcher = PsmnetMatcher(weights())
    matcher.batch = 8  # as on a GPU
    sizes, whole = [], InferenceEngine.disparities

    def cramped(self: InferenceEngine, left, right, size):
        sizes.append(len(left))
        if len(left) > 2:
            raise torch.OutOfMemoryError
        return whole(self, left, right, size)

    monkeypatch.setattr(InferenceEngine, "disparities", cramped)
    images = [noise(32, 64, seed) for seed in range(6)]
    maps = matcher.match_pairs(images, [(0, n) for n in range(1, 6)])
    assert sizes == [5, 2, 2, 1]
    assert matcher.batch == 2
    monkeypatch.undo()
    for n, disparity in enumerate(maps, start=1):
        np.testing.assert_allclose(disparity, matcher.match(images[0], images[n]), atol=1e-3)


def test_a_pair_that_does_not_fit_alone_says_what_would(monkeypatch) -> None:
    def full(*_: object) -> None:
        raise torch.OutOfMemoryError

    monkeypatch.setattr(InferenceEngine, "disparities", full)
    with pytest.raises(SettingError, match=r"--device: one pair of images does not fit .* use a smaller"):
        PsmnetMatcher(weights()).match(noise(32, 32), noise(32, 32))


def test_settings_tell_weights_convention_range_and_precision_apart(small: PsmnetMatcher) -> None:
    other = ruled_state(4)
    other["dres0.0.0.weight"] = other["dres0.0.0.weight"] + 1e-3
    unsaid = Weights(ruled_state(4), 4, weights().sha256, None, 32, "")
    matchers = [
        small,
        PsmnetMatcher(Weights(other, 4, content_sha256(other), True, 32, "")),
        PsmnetMatcher(unsaid, align_corners=False),
        PsmnetMatcher(weights(), max_disparity=48),
    ]
    assert len({matcher.settings for matcher in matchers}) == 4
    assert json.loads(small.settings)["weights_sha256"] == weights().sha256
    assert PsmnetMatcher(unsaid, align_corners=True).settings == small.settings


def test_the_upsampling_convention_has_no_default_and_no_disagreement() -> None:
    unsaid = Weights(ruled_state(4), 4, "", None, None, "w.tar")
    with pytest.raises(SettingError, match=r"w\.tar: the file does not say which upsampling .* 2018"):
        PsmnetMatcher(unsaid)
    with pytest.raises(SettingError, match=r"says align_corners=True, the command False"):
        PsmnetMatcher(weights(), align_corners=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": "gpu"}, "no device is called 'gpu'"),
        ({"device": "cuda:99"}, "there is no GPU cuda:99"),
        ({"device": "meta"}, "does not run on meta"),
        ({"precision": "fp8"}, "no precision is called 'fp8'"),
        ({"precision": "fp16"}, "fp16 is for a GPU"),
        ({"max_disparity": 100}, "100 px is not a disparity range"),
        ({"max_disparity": -16}, "-16 px is not a disparity range"),
    ],
)
def test_settings_that_make_no_sense_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        PsmnetMatcher(weights(), **options)


def test_half_precision_never_reaches_the_soft_argmin() -> None:
    network = PSMNet(**SMALL, align_corners=True)
    cost = torch.randn(1, 1, 8, 4, 4, generator=torch.Generator().manual_seed(0)) * 5
    exact = network.disparity(cost, (16, 16))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert torch.equal(network.disparity(cost, (16, 16)), exact)


def test_the_cost_grows_with_images_pairs_and_pixels(small: PsmnetMatcher, monkeypatch) -> None:
    clock = iter(range(100))
    monkeypatch.setattr("auditor.measurement.disparity.matchers.psmnet.preflight.perf_counter", lambda: next(clock))
    cost = frame_cost(small, (256, 512))
    assert (cost.seconds_per_image, cost.seconds_per_pair) == (4.0, 4.0)  # four times the pixels measured, 1 s each
    assert cost.frame_s(images=3, pairs=2) == 20.0
    assert (cost.device, cost.threads) == ("cpu", 1)


@pytest.mark.parametrize(("matcher", "package"), [("psmnet", "torch"), ("onnx:m", "onnxruntime")])
def test_a_package_that_is_not_installed_is_named_with_its_extra(matcher: str, package: str) -> None:
    code = (
        f"import sys; sys.modules[{package!r}] = None\n"
        "from auditor.measurement.disparity.matchers import find_matcher\n"
        f"find_matcher({matcher!r})"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert f"needs the package {package}; pip install 'auditor[" in done.stderr


def test_the_evidence_room_is_entered_without_torch() -> None:
    code = "import sys, auditor.measurement, auditor.measurement.disparity.matchers; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=dict(os.environ), check=False).returncode == 0


def test_a_frame_is_measured_with_each_image_seen_once(monkeypatch) -> None:
    counts = []
    features = InferenceEngine.features

    def counted(self: InferenceEngine, images: list[np.ndarray]) -> torch.Tensor:
        counts.append(len(images))
        return features(self, images)

    monkeypatch.setattr(InferenceEngine, "features", counted)
    rig = plane_rig()
    measurement, _ = measure(plane_frame(rig), rig, PsmnetMatcher(weights()))
    assert sum(counts) == 3
    assert all(count is not None and count.valid_px > 0 for count in measurement.counts)
    assert all(measurement.coverage[camera].unmatched_share in (None, 0.0) for camera in (1, 2, 3))


def test_frames_in_batches_have_the_disparities_of_single_ones_also_when_memory_runs_out(monkeypatch) -> None:
    rig = plane_rig()
    frames = [plane_frame(rig, depth_m) for depth_m in (6.0, 9.0, 12.0)]
    plain = [measure(frame, rig, PsmnetMatcher(weights()))[1].maps for frame in frames]
    matcher = PsmnetMatcher(weights())
    matcher.batch = 8  # as on a GPU
    really, sizes = InferenceEngine.disparities, []

    def small(engine, left, right, size):
        sizes.append(len(left))
        if len(left) > 2:
            raise torch.OutOfMemoryError
        return really(engine, left, right, size)

    monkeypatch.setattr(InferenceEngine, "disparities", small)
    batched = [evidence.maps for _, evidence in measure_stream(iter(frames), rig, matcher)]
    # All six pairs of two frames, half of them, half of that for good: also for the three pairs of the last frame.
    assert sizes == [6, 3, *[1] * 9]
    assert matcher.pairs_at_once == 1
    for one, other in zip(batched, plain, strict=True):
        assert one.keys() == other.keys()
        for pair, stereo in one.items():
            assert np.abs(stereo.disparity_px - other[pair].disparity_px).max() < 1e-3


def test_compiled_both_halves_are_and_nothing_else_changes(monkeypatch) -> None:
    half_res = []
    monkeypatch.setattr(torch, "compile", lambda work: half_res.append(work.__name__) or work)
    monkeypatch.setattr(torch.nn.Module, "compile", lambda module: half_res.append(type(module).__name__))
    compiled = PsmnetMatcher(weights(), compiled=True)
    assert half_res == ["Features", "costs"]
    assert compiled.settings == PsmnetMatcher(weights()).settings
    assert len(half_res) == 2
    left, right = noise(32, 64, 1), noise(32, 64, 2)
    assert np.array_equal(compiled.match(left, right), PsmnetMatcher(weights()).match(left, right))


def test_no_pointwise_convolution_is_strided() -> None:
    # Their backward pass corrupts memory in oneDNN 3.12: with 8 channels laid out last a training crashes.
    network = PSMNet(**SMALL, align_corners=True)
    layers = [
        layer for layer in network.modules() if isinstance(layer, torch.nn.Conv2d) and layer.kernel_size == (1, 1)
    ]
    assert layers
    assert all(layer.stride == (1, 1) for layer in layers)

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from auditor.errors import SettingError  # noqa: E402
from auditor.lab.training.checkpoints import CHECKPOINT, TrainingSettings, training_curve  # noqa: E402
from auditor.lab.training.psmnet import _loss, _rate, crops, train  # noqa: E402
from auditor.lab.training.samples import Sample, score  # noqa: E402
from auditor.measurement.disparity.matchers import MatcherOptions, SgbmMatcher, find_matcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.network import PSMNet  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import inspect_weights  # noqa: E402
from tests.making.psmnet_networks import noise  # noqa: E402

TOY = TrainingSettings(
    max_disparity=16, width=2, crop=(32, 48), batch=2, steps=4, validate_every=2, learning_rate=3e-3, seed=5
)


def sample(seed: int, height: int = 32, width: int = 64, range_px: int = 14) -> Sample:
    """A textured plane at some disparity, with every second truth missing as between a LiDAR's points."""
    rng = np.random.default_rng(seed)
    disparity = int(rng.integers(1, range_px))
    texture = noise(height, width + disparity, seed)
    truth = np.full((height, width), disparity, dtype=np.float32)
    truth[rng.random(truth.shape) < 0.5] = np.nan
    return np.ascontiguousarray(texture[:, :width]), np.ascontiguousarray(texture[:, disparity:]), truth


SAMPLES = [sample(seed) for seed in range(5)]
UNSEEN = {"planes": [sample(99)]}


def test_a_sample_is_what_the_matchers_call_a_left_and_a_right_image() -> None:
    assert score(SgbmMatcher(step=1), SAMPLES).over_3px_share < 0.35


def test_a_resumed_training_ends_with_every_bit_of_an_undisturbed_one(tmp_path: Path) -> None:
    whole = list(train(SAMPLES, UNSEEN, TOY, tmp_path / "whole"))
    parts = list(itertools.islice(train(SAMPLES, UNSEEN, TOY, tmp_path / "parts"), 1))
    torch.manual_seed(1234)  # whatever else draws numbers in between
    parts += train(SAMPLES, UNSEEN, TOY, tmp_path / "parts", resume=True)
    assert [row.step for row in whole] == [2, 4]
    assert parts == whole == training_curve(tmp_path / "parts")
    states = [torch.load(tmp_path / name / CHECKPOINT, weights_only=True) for name in ("whole", "parts")]
    for name, tensor in states[0]["state_dict"].items():
        assert torch.equal(tensor, states[1]["state_dict"][name]), name
    assert not torch.equal(states[0]["state_dict"]["dres0.0.0.weight"], torch.zeros(()))
    whole_state, part_state = (state["optimizer"]["state"] for state in states)
    assert all(torch.equal(whole_state[n]["exp_avg_sq"], part_state[n]["exp_avg_sq"]) for n in whole_state)


def test_a_training_that_is_over_may_be_given_more_steps(tmp_path: Path) -> None:
    list(train(SAMPLES, UNSEEN, dataclasses.replace(TOY, steps=2), tmp_path))
    assert [row.step for row in train(SAMPLES, UNSEEN, dataclasses.replace(TOY, steps=3), tmp_path, resume=True)] == [3]
    assert [row.step for row in training_curve(tmp_path)] == [2, 3]


def test_other_seeds_and_other_samples_train_another_network(tmp_path: Path) -> None:
    losses = {
        row.loss
        for name, settings, samples in (
            ("a", TOY, SAMPLES),
            ("b", dataclasses.replace(TOY, seed=6), SAMPLES),
            ("c", TOY, SAMPLES[::-1]),
        )
        for row in itertools.islice(train(samples, UNSEEN, settings, tmp_path / name), 1)
    }
    assert len(losses) == 3


def test_training_lowers_the_loss_on_its_samples(tmp_path: Path) -> None:
    settings = dataclasses.replace(TOY, steps=40, validate_every=10, learning_rate=2e-2, width=4)
    rows = list(train(SAMPLES[:2], UNSEEN, settings, tmp_path))
    assert rows[-1].loss < 0.6 * rows[0].loss


def test_a_checkpoint_holds_weights_with_their_settings(tmp_path: Path) -> None:
    list(train(SAMPLES, UNSEEN, dataclasses.replace(TOY, steps=1), tmp_path))
    matcher = find_matcher("psmnet", MatcherOptions(weights=tmp_path / CHECKPOINT))
    assert matcher.range_px == 16
    assert np.isfinite(matcher.match(SAMPLES[0][0], SAMPLES[0][1])).all()
    report = inspect_weights(tmp_path / CHECKPOINT)
    assert (report.width, report.align_corners, report.problems) == (2, False, ())
    assert sorted(path.name for path in tmp_path.iterdir()) == [CHECKPOINT]


def test_the_loss_is_smooth_l1_on_known_pixels_in_the_range_weighted_by_output() -> None:
    truth = torch.tensor([[[np.nan, 0.0, 10.0, 20.0, 16.0]]])
    outputs = [torch.tensor([[[9.0, 9.0, given, 9.0, 9.0]]]) for given in (10.5, 12.0, 7.0)]
    expected = 0.5 * (0.5 * 0.25) + 0.7 * 1.5 + 1.0 * 2.5
    assert _loss(tuple(outputs), truth, 16).item() == pytest.approx(expected)


def test_a_crop_without_a_known_pixel_changes_nothing_and_breaks_nothing(tmp_path: Path) -> None:
    left, right, truth = SAMPLES[0]
    blank = (left, right, np.full_like(truth, np.nan))
    (row,) = train([blank], UNSEEN, dataclasses.replace(TOY, steps=1), tmp_path)
    assert row.loss == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"max_disparity": 20}, "--max-disparity: .*a multiple of 16"),
        ({"crop": (30, 48)}, "--crop: .*multiples of 16"),
        ({"width": 0}, "--width"),
        ({"batch": 1}, "--batch: .*2 or more"),
        ({"steps": 0}, "--steps"),
        ({"learning_rate": 0.0}, "--learning-rate"),
        ({"learning_rate": float("nan")}, "--learning-rate"),
        ({"precision": "fp16"}, "--precision: .*fp32 or bf16"),
        ({"precision": "bf16"}, "--precision: .*fp32 on the CPU"),
        ({"crop": (64, 64)}, "no crop of"),
        ({"learning_rate": 1e30}, "the loss is nan at step 2"),
    ],
)
def test_settings_that_make_no_sense_are_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(SettingError, match=message):
        list(train(SAMPLES, UNSEEN, dataclasses.replace(TOY, **change), tmp_path))


def test_a_folder_is_neither_overwritten_nor_resumed_by_mistake(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="no training to resume"):
        list(train(SAMPLES, UNSEEN, TOY, tmp_path, resume=True))
    with pytest.raises(SettingError, match="No such file"):
        training_curve(tmp_path)
    short = dataclasses.replace(TOY, steps=1)
    list(train(SAMPLES, UNSEEN, short, tmp_path))
    with pytest.raises(SettingError, match="a training is here already"):
        list(train(SAMPLES, UNSEEN, short, tmp_path))
    with pytest.raises(SettingError, match=r"other settings: width 2 instead of 3, seed 5 instead of 6"):
        list(train(SAMPLES, UNSEEN, dataclasses.replace(short, width=3, seed=6), tmp_path, resume=True))


def test_missing_or_exhausted_samples_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="no samples to train on"):
        list(train([], UNSEEN, TOY, tmp_path))


def test_a_pass_takes_every_sample_once_and_in_an_order_of_its_own() -> None:
    flat = [(np.full((16, 16), 0, np.uint8),) * 2 + (np.full((16, 16), 1.0 + n, np.float32),) for n in range(6)]
    settings = dataclasses.replace(TOY, crop=(16, 16), batch=3)
    seen = [[int(crop[2][0, 0]) for crop in batch] for batch in itertools.islice(crops(flat, settings, 0), 4)]
    passes = [seen[0] + seen[1], seen[2] + seen[3]]
    assert all(sorted(one) == [1, 2, 3, 4, 5, 6] for one in passes)
    assert passes[0] != passes[1]
    later = [[int(crop[2][0, 0]) for crop in batch] for batch in itertools.islice(crops(flat, settings, 3), 1)]
    assert later == seen[3:]


def test_at_half_resolution_a_crop_has_half_the_disparities_and_no_mean_of_two() -> None:
    truth = np.full((32, 32), np.nan, dtype=np.float32)
    truth[:, :16], truth[1::2, 17::2] = 10.0, 20.0
    flat = (np.full((32, 32, 3), 90, np.uint8),) * 2 + (truth,)
    settings = dataclasses.replace(TOY, crop=(16, 16), step=2, max_disparity=32)
    left, right, halved = next(crops([flat], settings, 0))[0]
    assert left.shape == right.shape == halved.shape == (16, 16)
    assert (halved[:, :8] == 5.0).all()
    assert (halved[:, 8:] == 10.0).all()


def test_both_images_of_a_crop_change_their_light_and_not_alike() -> None:
    flat = (np.full((16, 16), 120, np.uint8),) * 2 + (np.full((16, 16), 3.0, np.float32),)
    settings = dataclasses.replace(TOY, crop=(16, 16), batch=8)
    means = [(left.mean(), right.mean()) for left, right, _ in next(crops([flat], settings, 0))]
    assert np.ptp(means, axis=0).min() > 20
    assert min(abs(left - right) for left, right in means) > 0.1
    assert max(abs(left - right) for left, right in means) < 60


def test_a_network_for_half_resolution_is_marked_and_its_range_is_that_of_the_image(tmp_path: Path) -> None:
    settings = dataclasses.replace(TOY, steps=1, step=2, max_disparity=32, crop=(16, 32))
    list(train(SAMPLES, UNSEEN, settings, tmp_path))
    matcher = find_matcher("psmnet", MatcherOptions(weights=tmp_path / CHECKPOINT))
    assert (matcher.step, matcher.colour, matcher.range_px) == (2, False, 32)
    disparity = matcher.match(SAMPLES[0][0][:31, :63], SAMPLES[0][1][:31, :63])
    assert disparity.shape == (16, 32)
    assert 0 <= disparity.min() < disparity.max() < 32


def test_the_learning_rate_rises_then_falls_to_zero() -> None:
    rates = [_rate(done, 100) for done in range(100)]
    assert rates[0] == pytest.approx(0.2)
    assert rates[4] == max(rates) == pytest.approx(1.0, abs=0.01)
    assert rates[4:] == sorted(rates[4:], reverse=True)
    assert rates[-1] < 0.001


def test_scores_count_pixels_without_a_disparity_as_wrong() -> None:
    class Fixed:
        name, settings, range_px, step, colour = "fixed", "", 64, 2, False

        def match(self, left, right):
            assert left.ndim == 2
            return np.array([[10.0, 14.0, np.nan]], dtype=np.float32)

    image = np.zeros((2, 5, 3), dtype=np.uint8)
    truth = np.array([[10.0, 11.0, 10.0, np.nan, 5.0], [np.nan, np.nan, 11.5, np.nan, 0.5]])
    found = score(Fixed(), [(image, image, truth)], least_px=1.0)
    assert found.pixels == 5
    assert found.mean_px == pytest.approx((0 + 1 + 4 + 2.5) / 4)
    assert found.over_3px_share == pytest.approx(2 / 5)
    assert score(Fixed(), []).mean_px is None


def test_the_published_size_has_the_published_parameters() -> None:
    settings = TrainingSettings()
    with torch.device("meta"):
        network = PSMNet(max_disparity=settings.max_disparity, align_corners=True, width=settings.width)
    assert sum(parameter.numel() for parameter in network.parameters()) == 5_224_768

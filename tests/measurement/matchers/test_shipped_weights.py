"""The weights that come with auditor: they are those that were published with it, and they match."""

import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from auditor.errors import SettingError  # noqa: E402
from auditor.identification.parameters import SHIPPED  # noqa: E402
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet import weights as shipped  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import load_weights  # noqa: E402
from tests.making.psmnet_networks import noise  # noqa: E402


def test_without_a_file_psmnet_has_the_weights_that_come_with_it() -> None:
    matcher = find_matcher("psmnet")
    named = find_matcher("psmnet", MatcherOptions(weights=shipped.SHIPPED))
    assert matcher.settings == named.settings
    assert load_weights(shipped.SHIPPED).sha256 in matcher.settings
    assert (matcher.range_px, matcher.step, matcher.colour, matcher.align_corners) == (192, 2, False, False)
    assert json.loads(matcher.settings) == SHIPPED, "the prior holds for what psmnet is unasked"


def test_they_find_the_disparity_of_a_shifted_texture() -> None:
    matcher = find_matcher("psmnet", MatcherOptions(max_disparity=64))
    texture = noise(64, 128)[..., 0].repeat(4, axis=0).repeat(4, axis=1)
    left, right = texture[:, :-20], texture[:, 20:]
    found = matcher.match(np.ascontiguousarray(left), np.ascontiguousarray(right))
    inside = found[:, 32:]
    assert np.median(np.abs(inside - 20.0)) < 1.0
    assert np.mean(np.abs(inside - 20.0) > 3.0) < 0.05


@pytest.mark.parametrize("damage", ["a byte is another", "the end is missing", "all is another network's"])
def test_a_damaged_file_is_refused_before_it_is_read(
    damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = bytearray(shipped.SHIPPED.read_bytes())
    if damage == "a byte is another":
        content[-1] ^= 1
    elif damage == "the end is missing":
        del content[-1000:]
    else:
        content = bytearray(b"PK")
    copy = tmp_path / shipped.SHIPPED.name
    copy.write_bytes(content)
    monkeypatch.setattr(shipped, "SHIPPED", copy)
    with pytest.raises(SettingError, match=r"fp16\.safetensors: damaged or changed.*install auditor again"):
        find_matcher("psmnet")


def test_a_missing_file_is_an_error_of_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shipped, "SHIPPED", tmp_path / "gone.safetensors")
    with pytest.raises(SettingError, match=r"gone\.safetensors: No such file"):
        find_matcher("psmnet")


def test_another_convention_than_theirs_is_refused() -> None:
    with pytest.raises(SettingError, match="the file says align_corners=False"):
        find_matcher("psmnet", MatcherOptions(align_corners=True))

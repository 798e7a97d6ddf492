import json
from pathlib import Path

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

from auditor.errors import SettingError  # noqa: E402
from auditor.measurement.disparity.matchers import Matcher, MatcherOptions, find_matcher  # noqa: E402


def model(
    path: Path,
    toml: str = "range_px = 64\n",
    *,
    size: tuple[int | str, int | str] = ("H", "W"),
    channels: int = 3,
    pool: int = 1,
    operator: str = "Sub",
) -> Path:
    """A model whose disparity is the mean over colours of (left - right), pooled, and its description beside it."""
    make = onnx.helper
    nodes = [
        make.make_node(operator, ["left", "right"], ["difference"]),
        make.make_node("ReduceMean", ["difference", "colours"], ["mean"]),
        make.make_node("AveragePool", ["mean"], ["disparity"], kernel_shape=[pool, pool], strides=[pool, pool]),
    ]
    inputs = [make.make_tensor_value_info(n, 1, [1, channels, *size]) for n in ("left", "right")]
    output = make.make_tensor_value_info("disparity", 1, [1, 1, None, None])
    colours = make.make_tensor("colours", onnx.TensorProto.INT64, [1], [1])
    graph = make.make_graph(nodes, "difference", inputs, [output], [colours])
    opset = make.make_opsetid("", 18)
    path.write_bytes(make.make_model(graph, opset_imports=[opset], ir_version=9).SerializeToString())
    path.with_suffix(".toml").write_text(toml)
    return path


def opened(path: Path) -> Matcher:
    return find_matcher(f"onnx:{path}")


def pictures(height: int = 6, width: int = 10) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    left, right = (rng.integers(0, 256, (height, width, 3)).astype(np.uint8) for _ in range(2))
    return left, right


def test_a_model_gets_left_and_right_scaled_and_its_output_is_the_disparity(tmp_path: Path) -> None:
    left, right = pictures()
    matcher = opened(model(tmp_path / "m.onnx"))
    expected = (left.astype(float) - right).mean(axis=2) / 255
    found = matcher.match(left, right)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert (matcher.name, matcher.range_px, matcher.step, matcher.colour) == ("onnx", 64, 1, True)


def test_channels_are_in_the_order_and_scale_described(tmp_path: Path) -> None:
    blue = np.zeros((4, 4, 3), dtype=np.uint8)
    blue[..., 0] = 255
    toml = 'range_px = 64\n[input]\ncolour = "{}"\nmean = [0, 0, 0.5]\ndeviation = [1, 1, 0.25]\n[output]\nfactor = 3'
    black = np.zeros_like(blue)
    # The third channel alone is scaled by the deviation of 0.25: it is blue where the order is RGB.
    rgb = opened(model(tmp_path / "rgb.onnx", toml.format("rgb"))).match(blue, black)
    bgr = opened(model(tmp_path / "bgr.onnx", toml.format("bgr"))).match(blue, black)
    assert (rgb[0, 0], bgr[0, 0]) == (pytest.approx(4.0), pytest.approx(1.0))


def test_a_grey_model_gets_grey_images_and_a_colour_one_takes_them_three_times(tmp_path: Path) -> None:
    left, right = (image[..., 0] for image in pictures())
    grey = opened(model(tmp_path / "g.onnx", 'range_px = 64\n[input]\ncolour = "grey"\n', channels=1))
    assert not grey.colour
    np.testing.assert_allclose(
        grey.match(left, right), opened(model(tmp_path / "c.onnx")).match(left, right), atol=1e-6
    )


@pytest.mark.parametrize("pad", ["top right", "bottom right"])
def test_images_are_padded_to_multiples_and_the_disparity_cut_back(tmp_path: Path, pad: str) -> None:
    left, right = pictures(5, 7)
    toml = f'range_px = 64\n[input]\nmultiple = 8\npad = "{pad}"\n'
    plain = opened(model(tmp_path / "plain.onnx")).match(left, right)
    fixed = model(tmp_path / "padded.onnx", toml, size=(8, 8))
    np.testing.assert_array_equal(opened(fixed).match(left, right), plain)


def test_a_model_of_one_size_takes_what_fits_and_refuses_the_rest(tmp_path: Path) -> None:
    matcher = opened(model(tmp_path / "m.onnx", size=(8, 12)))
    left, right = pictures(6, 10)
    np.testing.assert_allclose(matcher.match(left, right), (left.astype(float) - right).mean(axis=2) / 255, atol=1e-6)
    with pytest.raises(SettingError, match="takes 8 x 12 pixels, the images have 9 x 10"):
        matcher.match(*pictures(9, 10))


def test_half_resolution_maps_of_odd_images_keep_their_last_row_and_column(tmp_path: Path) -> None:
    matcher = opened(model(tmp_path / "m.onnx", "range_px = 64\nstep = 2\n[input]\nmultiple = 4\n", pool=2))
    left, right = pictures(7, 9)
    found = matcher.match(left, right)
    assert found.shape == (4, 5)
    expected = (left.astype(float) - right).mean(axis=2)[:6, :8].reshape(3, 2, 4, 2).mean(axis=(1, 3)) / 255
    np.testing.assert_allclose(found[:3, :4], expected, atol=1e-6)


def test_what_is_no_number_is_unknown(tmp_path: Path) -> None:
    left, right = pictures()
    right[2:4] = 0
    left[2] = 0
    found = opened(model(tmp_path / "m.onnx", operator="Div")).match(left, right)
    assert np.isnan(found[2:4]).all()
    assert np.isfinite(found[5]).all()


def test_settings_bind_the_model_and_its_description(tmp_path: Path) -> None:
    matchers = [
        opened(model(tmp_path / "a.onnx")),
        opened(model(tmp_path / "b.onnx", operator="Div")),
        opened(model(tmp_path / "c.onnx", "range_px = 64\n[output]\nfactor = -1\n")),
    ]
    assert len({matcher.settings for matcher in matchers}) == 3
    (tmp_path / "elsewhere").mkdir()
    assert opened(model(tmp_path / "elsewhere" / "d.onnx")).settings == matchers[0].settings
    assert json.loads(matchers[0].settings)["range_px"] == 64


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("", "range_px makes no sense; it is the largest disparity"),
        ("range_px = true", "range_px makes no sense"),
        ('range_px = "192"', "range_px makes no sense"),
        ("range_px = 64\nsize = 3", "size is not known here; use: range_px, step"),
        ("range_px = 64\ninput = 3", "3 is not known here; use: colour"),
        ("range_px = 64\nstep = 3", "step makes no sense; it is one of"),
        ("range_px = 64\nstep = 2", "input.multiple makes no sense; it is a multiple of step"),
        ('range_px = 64\nstep = 2\n[input]\nmultiple = 2\npad = "top right"', "input.pad makes no sense; it is bottom"),
        ("range_px = 64\n[input]\ndivisor = 0", "input.divisor"),
        ("range_px = 64\n[input]\nmean = 0.5", "input.mean"),
        ("range_px = 64\n[input]\nmean = [0.5, 0.5]", "input.mean"),
        ("range_px = 64\n[input]\ndeviation = [0.0]", "input.deviation"),
        ("range_px = 64\n[input]\ndeviation = [nan]", "input.deviation"),
        ('range_px = 64\n[input]\ncolour = "red"', "input.colour"),
        ("range_px = 64\n[input]\nleft = 1", "input.left"),
        ("range_px = 64\n[output]\nfactor = 0", "output.factor"),
        ("range_px =", "no readable TOML"),
        ('range_px = 64\n[input]\nleft = "links"', "the model's inputs are left, right, its description names links"),
        ('range_px = 64\n[output]\ndisparity = "d"', "the model's outputs are disparity, its description names d"),
    ],
)
def test_a_description_that_makes_no_sense_is_refused_with_what_does(tmp_path: Path, toml: str, message: str) -> None:
    with pytest.raises(SettingError, match=rf"m\.toml: .*{message}"):
        opened(model(tmp_path / "m.onnx", toml))


def test_files_that_are_no_models_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.onnx"
    with pytest.raises(SettingError, match=r"m\.toml: there is no description beside the model"):
        opened(path)
    path.with_suffix(".toml").write_text("range_px = 64")
    with pytest.raises(SettingError, match=r"m\.onnx: No such file"):
        opened(path)
    for content in (b"", b"not a model"):
        path.write_bytes(content)
        with pytest.raises(SettingError, match=r"m\.onnx: no ONNX model that can be run"):
            opened(path)


def test_a_model_that_gives_another_size_or_takes_other_channels_is_refused_when_it_runs(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match=r"gives \(1, 1, 3, 5\) where its description means \(6, 10\)"):
        opened(model(tmp_path / "half.onnx", pool=2)).match(*pictures())
    with pytest.raises(SettingError, match=r"fails on \(1, 3, 6, 10\)"):
        opened(model(tmp_path / "grey.onnx", channels=1)).match(*pictures())


def test_a_device_that_is_not_there_and_options_of_other_matchers_are_refused(tmp_path: Path) -> None:
    path = model(tmp_path / "m.onnx")
    with pytest.raises(SettingError, match="onnxruntime has no device 'tpu'"):
        find_matcher(f"onnx:{path}", MatcherOptions(device="tpu"))
    with pytest.raises(SettingError, match="--precision: onnx takes no such option"):
        find_matcher(f"onnx:{path}", MatcherOptions(precision="fp16"))
    with pytest.raises(SettingError, match="--weights: sgbm takes no such option"):
        find_matcher("sgbm", MatcherOptions(weights=path))
    with pytest.raises(SettingError, match=r"no matcher is called 'onnx'; use one of: .*onnx:FILE"):
        find_matcher("onnx")

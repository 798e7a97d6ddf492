import argparse
import io
import os
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from hypothesis import given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402
from safetensors.torch import load_file, save_file  # noqa: E402

from auditor.errors import SettingError  # noqa: E402
from auditor.measurement.disparity.matchers import Matcher, MatcherOptions, find_matcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import (  # noqa: E402
    content_sha256,
    convert_weights,
    inspect_weights,
    load_weights,
)
from tests.making.psmnet_networks import ruled_state  # noqa: E402

STATE = ruled_state(4)
PREFIXED = {f"module.{name}": tensor for name, tensor in STATE.items()}
LAST = "classif3.2.weight"


def opened(path: Path) -> Matcher:
    return find_matcher("psmnet", MatcherOptions(weights=path, align_corners=True, max_disparity=32))


def training_checkpoint() -> dict[str, object]:
    """What training scripts of 2018 leave: prefixed names, optimiser state, numpy scalars, their arguments."""
    moments = {"step": torch.tensor(1.0), "exp_avg": torch.ones(3), "exp_avg_sq": torch.ones(3)}
    return {
        "epoch": 300,
        "state_dict": PREFIXED,
        "optimizer": {"state": {0: moments}, "param_groups": [{"lr": 0.001, "betas": (0.9, 0.999), "params": [0]}]},
        "train_loss": np.float64(0.5),
        "losses": np.arange(3.0),
        "args": argparse.Namespace(maxdisp=192),
    }


CONTENTS = {
    "plain": lambda: STATE,
    "prefixed": lambda: PREFIXED,
    "in a dictionary": lambda: {"state_dict": PREFIXED},
    "beside what training leaves": training_checkpoint,
}


@pytest.mark.parametrize(
    ("content", "zipped"),
    [*((content, True) for content in CONTENTS.values()), (training_checkpoint, False)],
    ids=[*CONTENTS, "beside what training leaves, in the legacy format"],
)
def test_checkpoints_load_in_both_formats_with_and_without_prefix_and_extras(
    tmp_path: Path, content: Callable[[], object], zipped: bool
) -> None:
    path = tmp_path / "weights.tar"
    torch.save(content(), path, _use_new_zipfile_serialization=zipped)
    weights = load_weights(path)
    assert list(weights.state) == list(STATE)
    assert all(torch.equal(weights.state[name], STATE[name]) for name in STATE)
    assert (weights.width, weights.align_corners, weights.sha256) == (4, None, content_sha256(STATE))


def test_what_training_left_beside_the_parameters_is_named_and_not_kept(tmp_path: Path) -> None:
    torch.save(training_checkpoint(), tmp_path / "weights.tar", _use_new_zipfile_serialization=False)
    report = inspect_weights(tmp_path / "weights.tar")
    assert report.left_aside == ("epoch", "optimizer", "train_loss", "losses", "args")
    assert (report.layout, report.tensors, report.width, report.problems) == ("torch legacy", 514, 4, ())


def test_checkpoints_older_than_the_batch_counters_load(tmp_path: Path) -> None:
    torch.save({name: t for name, t in STATE.items() if "num_batches" not in name}, tmp_path / "w.pth")
    assert load_weights(tmp_path / "w.pth").sha256 == content_sha256(STATE)
    assert opened(tmp_path / "w.pth").range_px == 32


class Payload:
    """Unpickled by python, it makes a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, (str(self.folder),)


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "legacy"])
@pytest.mark.parametrize("place", ["alone", "in the state dict", "beside it"])
def test_a_pickle_that_would_run_code_is_refused_and_does_not_run(tmp_path: Path, place: str, zipped: bool) -> None:
    ran = tmp_path / "ran"
    payload = Payload(ran)
    content = {
        "alone": payload,
        "in the state dict": {**STATE, LAST: payload},
        "beside it": {"state_dict": STATE, "optimizer": payload},
    }[place]
    path = tmp_path / "evil.tar"
    torch.save(content, path, _use_new_zipfile_serialization=zipped)
    with pytest.raises(
        SettingError, match=r"evil\.tar: refused, nothing of it was run: its pickle asks for '\w+\.mkdir'"
    ):
        load_weights(path)
    with pytest.raises(SettingError, match="refused"):
        inspect_weights(path)
    assert not ran.exists()
    torch.load(path, weights_only=False)  # the payload works: it was the loading that stopped it
    assert ran.is_dir()


def test_a_bare_pickle_that_would_run_code_is_refused_and_does_not_run(tmp_path: Path) -> None:
    ran = tmp_path / "ran"
    path = tmp_path / "evil.pth"
    path.write_bytes(pickle.dumps(Payload(ran), protocol=2))
    with pytest.raises(SettingError, match="refused"):
        load_weights(path)
    assert not ran.exists()


def test_the_stand_ins_for_numpy_are_gone_after_loading(tmp_path: Path) -> None:
    torch.save({"loss": np.float64(1)}, tmp_path / "w.pt")
    with pytest.raises(SettingError, match="missing"):
        load_weights(tmp_path / "w.pt")
    with pytest.raises(pickle.UnpicklingError):
        torch.load(tmp_path / "w.pt", weights_only=True)


def test_a_whole_pickled_network_is_refused_with_its_class(tmp_path: Path) -> None:
    torch.save(torch.nn.Linear(1, 1), tmp_path / "w.pt")
    with pytest.raises(SettingError, match=r"asks for 'torch\.nn\.modules\.linear\.Linear'.*save its state_dict alone"):
        load_weights(tmp_path / "w.pt")


def test_missing_unexpected_and_misshapen_entries_are_listed(tmp_path: Path) -> None:
    state = {name: tensor for name, tensor in STATE.items() if name != LAST}
    state["classif4.2.weight"] = STATE[LAST]
    state["dres0.0.0.weight"] = torch.zeros(1, 2)
    torch.save(state, tmp_path / "w.pt")
    message = (
        r"w\.pt: 1 missing: classif3\.2\.weight; 1 unexpected: classif4\.2\.weight; "
        r"1 of another shape: dres0\.0\.0\.weight \(1, 2\) for \(4, 8, 3, 3, 3\); use weights of"
    )
    with pytest.raises(SettingError, match=message):
        load_weights(tmp_path / "w.pt")
    report = inspect_weights(tmp_path / "w.pt")
    assert (report.missing, report.unexpected) == ((LAST,), ("classif4.2.weight",))
    assert report.weights_sha256 is None


def test_a_files_own_names_cannot_break_the_line(tmp_path: Path) -> None:
    torch.save({**STATE, "evil\n\x1b[2J": torch.zeros(1)}, tmp_path / "w.pt")
    with pytest.raises(SettingError, match=r"1 unexpected: 'evil\\n\\x1b\[2J'"):
        load_weights(tmp_path / "w.pt")


def test_long_lists_are_cut_short_in_the_error_and_whole_in_the_report(tmp_path: Path) -> None:
    torch.save({}, tmp_path / "w.pt")
    with pytest.raises(SettingError, match="and 423 more"):
        load_weights(tmp_path / "w.pt")
    assert len(inspect_weights(tmp_path / "w.pt").missing) == 429


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_no_numbers_are_refused(tmp_path: Path, value: float) -> None:
    torch.save({**STATE, LAST: STATE[LAST] * value}, tmp_path / "w.pt")
    with pytest.raises(SettingError, match=r"1 are no plain finite numbers: classif3\.2\.weight"):
        load_weights(tmp_path / "w.pt")


def test_a_tensor_of_another_kind_is_refused(tmp_path: Path) -> None:
    torch.save({**STATE, LAST: STATE[LAST].to_sparse()}, tmp_path / "w.pt")
    with pytest.raises(SettingError, match="no plain finite numbers"):
        load_weights(tmp_path / "w.pt")


def test_half_precision_weights_are_widened(tmp_path: Path) -> None:
    half = {name: t.half() if t.is_floating_point() else t for name, t in STATE.items()}
    torch.save(half, tmp_path / "w.pt")
    assert load_weights(tmp_path / "w.pt").state[LAST].dtype == torch.float32


def test_conversion_keeps_the_weights_and_says_what_they_need(tmp_path: Path) -> None:
    torch.save(training_checkpoint(), tmp_path / "w.tar")
    converted = convert_weights(tmp_path / "w.tar", tmp_path / "w.safetensors", align_corners=True, max_disparity=32)
    assert (converted.align_corners, converted.max_disparity) == (True, 32)
    assert converted.sha256 == content_sha256(STATE)
    assert torch.equal(load_file(tmp_path / "w.safetensors")[LAST], STATE[LAST])
    before = opened(tmp_path / "w.tar")
    assert find_matcher("psmnet", MatcherOptions(weights=tmp_path / "w.safetensors")).settings == before.settings
    assert inspect_weights(tmp_path / "w.safetensors").layout == "safetensors"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["w.safetensors", "w.tar"]


def test_conversion_asks_for_the_convention_and_overwrites_nothing(tmp_path: Path) -> None:
    torch.save(STATE, tmp_path / "w.tar")
    target = tmp_path / "w.safetensors"
    with pytest.raises(SettingError, match="does not say which upsampling"):
        convert_weights(tmp_path / "w.tar", target)
    target.write_bytes(b"mine")
    with pytest.raises(SettingError, match="a file of that name exists"):
        convert_weights(tmp_path / "w.tar", target, align_corners=True)
    assert target.read_bytes() == b"mine"
    with pytest.raises(SettingError, match="converted weights are safetensors"):
        convert_weights(tmp_path / "w.tar", tmp_path / "w.pth", align_corners=True)
    with pytest.raises(SettingError, match="No such file"):
        convert_weights(tmp_path / "w.tar", tmp_path / "no" / "w.safetensors", align_corners=True)


def test_a_safetensors_file_of_others_loads_with_the_convention_given(tmp_path: Path) -> None:
    save_file(PREFIXED, tmp_path / "w.safetensors")
    weights = load_weights(tmp_path / "w.safetensors")
    assert (weights.sha256, weights.align_corners) == (content_sha256(STATE), None)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no weights that can be read"),
        (b"not a checkpoint", "no weights that can be read"),
        (b"PK\x03\x04 cut", "no weights that can be read"),
        (b"\x10\0\0\0\0\0\0\0{ no json }", "no readable safetensors file"),
        (b"\x02\0\0\0\0\0\0\0{}", "missing"),
    ],
)
def test_files_of_another_kind_are_refused_in_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "w.tar"
    path.write_bytes(content)
    with pytest.raises(SettingError, match=message) as caught:
        load_weights(path)
    assert "\n" not in str(caught.value)


def test_a_folder_and_nothing_at_all_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.tar"):
        with pytest.raises(SettingError, match=r"directory|No such file"):
            load_weights(path)


@pytest.mark.filterwarnings("ignore:.*torch.jit:DeprecationWarning")
def test_a_torchscript_program_is_told_apart_from_weights(tmp_path: Path) -> None:
    torch.jit.save(torch.jit.trace(torch.nn.ReLU(), torch.zeros(1)), tmp_path / "w.pt")
    with pytest.raises(SettingError, match="a TorchScript program, not weights"):
        load_weights(tmp_path / "w.pt")


def saved(zipped: bool) -> bytes:
    file = io.BytesIO()
    few = {"module.classif3.2.weight": STATE[LAST], "loss": np.float64(1)}
    torch.save({"state_dict": few}, file, _use_new_zipfile_serialization=zipped)
    return file.getvalue()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(data=st.data())
def test_a_damaged_checkpoint_is_always_a_clear_error(tmp_path_factory, data) -> None:
    content = bytearray(data.draw(st.sampled_from([saved(True), saved(False)])))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("weights") / "w.tar"
    path.write_bytes(bytes(content[: data.draw(st.integers(1, len(content)))]))
    with pytest.raises(SettingError):
        load_weights(path)

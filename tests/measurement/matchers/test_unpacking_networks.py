"""Files of networks that unpack to more than they hold, and the memory that is refused to them."""

import io
import resource
import struct
import zipfile
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

from onnx import TensorProto, helper  # noqa: E402

from auditor.errors import SettingError  # noqa: E402
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher  # noqa: E402
from auditor.measurement.disparity.matchers.psmnet.weights import inspect_weights  # noqa: E402

FEW, MANY = 10, 100_000_000


def peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def checkpoint_that_inflates(path: Path) -> Path:
    """A checkpoint whose one tensor has 400 MB of zeros, deflated to 0.4 MB."""
    file = io.BytesIO()
    torch.save({"a": torch.zeros(FEW)}, file)
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for name in source.namelist():
            content = source.read(name)
            if name.endswith("data.pkl"):
                content = content.replace(b"K" + bytes([FEW]), b"J" + struct.pack("<i", MANY))
            target.writestr(name, bytes(4 * MANY) if name.endswith("/data/0") else content)
    return path


def test_a_checkpoint_that_inflates_is_refused_before_torch_reads_it(tmp_path: Path) -> None:
    path = checkpoint_that_inflates(tmp_path / "bomb.pth")
    assert path.stat().st_size < 1_000_000
    before = peak_mb()
    with pytest.raises(SettingError, match="the file has unpacked too much already"):
        inspect_weights(path)
    assert peak_mb() < before + 100


def test_a_checkpoint_whose_members_share_their_bytes_is_refused(tmp_path: Path) -> None:
    torch.save({"a": torch.zeros(20_000_000)}, tmp_path / "whole.pth")
    content = (tmp_path / "whole.pth").read_bytes()
    end = content.rindex(b"PK\5\6")
    size, start = struct.unpack_from("<LL", content, end + 12)
    directory = content[start : start + size]
    [entry] = [b"PK\1\2" + part for part in directory.split(b"PK\1\2") if b"/data/0" in part]
    more = b"".join(entry.replace(b"/data/0", b"/data/%d" % number) for number in range(1, 10))
    ending = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 16, 16, size + len(more), start, 0)
    (tmp_path / "shared.pth").write_bytes(content[: start + size] + more + ending)
    with pytest.raises(SettingError, match="its members share their bytes"):
        inspect_weights(tmp_path / "shared.pth")


def test_an_onnx_model_of_sparse_tensors_gets_no_memory_for_them(tmp_path: Path) -> None:
    """600 bytes that would unpack to 9 GB."""
    many = range(5)
    values = [helper.make_tensor(f"big{k}", TensorProto.FLOAT, [1], [1.0]) for k in many]
    places = [helper.make_tensor(f"i{k}", TensorProto.INT64, [1], [5]) for k in many]
    nodes = [helper.make_node("ReduceSum", [f"big{k}"], [f"s{k}"], keepdims=0) for k in many]
    nodes += [helper.make_node("Sum", [*(f"s{k}" for k in many), "left", "right"], ["disparity"])]
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 3, 8, 8]) for name in ("left", "right")]
    outputs = [helper.make_tensor_value_info("disparity", TensorProto.FLOAT, None)]
    graph = helper.make_graph(nodes, "sparse", inputs, outputs)
    sparse = zip(values, places, strict=True)
    graph.sparse_initializer.extend(helper.make_sparse_tensor(*one, [450_000_000]) for one in sparse)
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    made.ir_version = 8
    (tmp_path / "sparse.onnx").write_bytes(made.SerializeToString())
    (tmp_path / "sparse.toml").write_text("range_px = 64")
    before, limits = peak_mb(), resource.getrlimit(resource.RLIMIT_DATA)
    with pytest.raises(SettingError, match="no ONNX model that can be run"):
        find_matcher(f"onnx:{tmp_path / 'sparse.onnx'}", MatcherOptions())
    assert peak_mb() < before + 1000
    assert resource.getrlimit(resource.RLIMIT_DATA) == limits


def test_a_model_larger_than_any_network_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "large.onnx").open("wb") as file:
        file.truncate((1 << 30) + 1)
    (tmp_path / "large.toml").write_text("range_px = 64")
    with pytest.raises(SettingError, match="networks are smaller"):
        find_matcher(f"onnx:{tmp_path / 'large.onnx'}", MatcherOptions())

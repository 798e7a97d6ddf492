"""Tiny detectors in ONNX files: their boxes never change, and their scores are a share of what their input holds."""

from pathlib import Path

import numpy as np
import onnx


def write_detector(
    path: Path, toml: str, boxes: object, scores: object, shape: list[object], **outputs: object
) -> Path:
    """A model that gives (1, M, K) boxes and (1, M) or (1, M, C) scores, the latter less the mean of its input."""
    make, proto = onnx.helper, onnx.TensorProto
    constants = {"boxes": boxes, "sure": scores} | outputs
    tensors = [
        onnx.numpy_helper.from_array(np.asarray(v, np.float32)[np.newaxis], f"{n}_") for n, v in constants.items()
    ]
    kind = proto.UINT8 if 'type = "uint8"' in toml else proto.FLOAT
    nodes = [make.make_node("Identity", [f"{name}_"], [name]) for name in constants]
    nodes += [
        make.make_node("Cast", ["input"], ["values"], to=proto.FLOAT),
        make.make_node("ReduceMean", ["values"], ["mean"], keepdims=0),
        make.make_node("Sub", ["sure", "mean"], ["scores"]),
    ]
    given = [make.make_tensor_value_info(name, proto.FLOAT, None) for name in ("boxes", "scores", *outputs)]
    taken = [make.make_tensor_value_info("input", kind, shape)]
    graph = make.make_graph(nodes, "detector", taken, given, tensors)
    opset = make.make_opsetid("", 18)
    path.write_bytes(make.make_model(graph, opset_imports=[opset], ir_version=9).SerializeToString())
    path.with_suffix(".toml").write_text(toml)
    return path


CAMERA = """
sensor = "camera"
names = ["Car", "", "Pedestrian"]
score = 0.2
[input]
name = "input"
{input}
[output]
{output}
"""

CLOUD = """
sensor = "cloud"
names = ["Car"]
score = 0.2
[input]
name = "input"
points = 64
{input}
[output]
labels = ""
{output}
"""


def write_camera_detector(
    path: Path, boxes: object, scores: object, *, taken: str = "", given: str = 'labels = ""', **outputs: object
) -> Path:
    """A camera detector of any size of image."""
    shape: list[object] = [1, "C", "H", "W"] if "nhwc" not in taken else [1, "H", "W", "C"]
    return write_detector(path, CAMERA.format(input=taken, output=given), boxes, scores, shape, **outputs)


def write_cloud_detector(path: Path, boxes: object, scores: object, *, taken: str = "", given: str = "") -> Path:
    """A cloud detector of points or of a grid."""
    shape: list[object] = [1, "C", "H", "W"] if "grid" in taken else [1, "N", "C"]
    return write_detector(path, CLOUD.format(input=taken, output=given), boxes, scores, shape)


def hostile_models() -> dict[str, onnx.ModelProto]:
    """Models that need another file, more memory than there is, or custom operators."""
    make, proto = onnx.helper, onnx.TensorProto
    taken = [make.make_tensor_value_info("input", proto.FLOAT, [1, 3, "H", "W"])]
    given = [make.make_tensor_value_info(name, proto.FLOAT, None) for name in ("boxes", "scores")]
    outside = proto(name="file", data_type=proto.FLOAT, dims=[4], data_location=proto.EXTERNAL)
    outside.external_data.add(key="location", value="../../etc/passwd")
    huge = onnx.numpy_helper.from_array(np.array([1, 1 << 38, 4]), "shape")
    tail = [make.make_node("ReduceMean", ["input"], ["scores"])]
    nodes = {
        "a file": ([make.make_node("Identity", ["file"], ["boxes"]), *tail], [outside]),
        "memory": ([make.make_node("ConstantOfShape", ["shape"], ["boxes"]), *tail], [huge]),
        "operators": ([make.make_node("Shell", ["input"], ["boxes"], domain="custom"), *tail], []),
    }
    opsets = [make.make_opsetid("", 18), make.make_opsetid("custom", 1)]
    return {
        name: make.make_model(make.make_graph(of_it, name, taken, given, tensors), opset_imports=opsets, ir_version=9)
        for name, (of_it, tensors) in nodes.items()
    }

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

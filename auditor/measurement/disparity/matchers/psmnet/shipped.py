"""The weights that come with auditor, trained on its own synthetic streets alone (docs/psmnet.md)."""

from pathlib import Path

from auditor.measurement.disparity.matchers.psmnet.weights import Weights, load_weights

SHIPPED = Path(__file__).with_name("streets_half_resolution_fp16.safetensors")
SHIPPED_SHA256 = "db9bf300fcad8032343af280728e539e221a462974593a5aee2f27f8024d7fd5"


def shipped_weights() -> Weights:
    """The weights for grey images at half resolution; raises SettingError where the file is missing or was changed."""
    return load_weights(SHIPPED, file_sha256=SHIPPED_SHA256)

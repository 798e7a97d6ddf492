"""PSMNet, the matcher of the paper's experiments: compatible with the published checkpoints, safe to load."""

from auditor.measurement.disparity.matchers.psmnet.matcher import PsmnetMatcher, open_psmnet
from auditor.measurement.disparity.matchers.psmnet.preflight import (
    Cost,
    PrecisionCheck,
    ScaleCheck,
    check_precision,
    check_scale,
    first_frames_warnings,
    frame_cost,
)
from auditor.measurement.disparity.matchers.psmnet.weights import (
    Weights,
    WeightsReport,
    convert_weights,
    inspect_weights,
    load_weights,
)

__all__ = [
    "Cost",
    "PrecisionCheck",
    "PsmnetMatcher",
    "ScaleCheck",
    "Weights",
    "WeightsReport",
    "check_precision",
    "check_scale",
    "convert_weights",
    "first_frames_warnings",
    "frame_cost",
    "inspect_weights",
    "load_weights",
    "open_psmnet",
]

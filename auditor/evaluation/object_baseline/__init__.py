"""The paper's object-level baseline: objects that each sensor sees by itself, and where they do not match."""

from auditor.evaluation.object_baseline.runner import ObjectTask, check_detectors, evaluate_objects

__all__ = ["ObjectTask", "check_detectors", "evaluate_objects"]

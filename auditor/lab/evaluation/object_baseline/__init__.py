"""The paper's object-level baseline: the objects that each sensor sees by itself are compared."""

from auditor.lab.evaluation.object_baseline.runner import ObjectTask, check_detectors, evaluate_objects

__all__ = ["ObjectTask", "check_detectors", "evaluate_objects"]

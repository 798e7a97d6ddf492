"""The paper's experiments on clean recordings: attacked in memory, measured into a store, answered in SQL."""

from auditor.evaluation.running import Evaluated, EvaluateTask, evaluate_source, experiments_of
from auditor.evaluation.sources import Recorded, Source, Street

__all__ = ["EvaluateTask", "Evaluated", "Recorded", "Source", "Street", "evaluate_source", "experiments_of"]

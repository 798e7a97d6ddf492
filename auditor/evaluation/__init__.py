"""The paper's experiments on clean recordings: attacked in memory, measured into a store, answered in SQL."""

from auditor.evaluation.runner import Evaluated, EvaluateTask, Task, evaluate_source, experiments_of
from auditor.evaluation.sources import Recorded, Source, Street
from auditor.evaluation.verdicts import judge_cases

__all__ = [
    "EvaluateTask",
    "Evaluated",
    "Recorded",
    "Source",
    "Street",
    "Task",
    "evaluate_source",
    "experiments_of",
    "judge_cases",
]

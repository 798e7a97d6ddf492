"""The paper's experiments on clean recordings: frames are attacked in memory, measured, judged and kept in a store."""

from auditor.lab.evaluation.missed import keep_missed
from auditor.lab.evaluation.runner import EvaluateTask, EvaluationWork, Task, evaluate_source, experiments_of
from auditor.lab.evaluation.sources import RecordingSource, Source, Street
from auditor.lab.evaluation.verdicts import judge_cases

__all__ = [
    "EvaluateTask",
    "EvaluationWork",
    "RecordingSource",
    "Source",
    "Street",
    "Task",
    "evaluate_source",
    "experiments_of",
    "judge_cases",
    "keep_missed",
]

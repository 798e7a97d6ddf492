"""Many recordings, one after the other or at the same time, each within its budget."""

from auditor.engines.limits import MEMORY_MB, Limits, limits_of
from auditor.engines.processes import Outcome, Progress, run_all

__all__ = ["MEMORY_MB", "Limits", "Outcome", "Progress", "limits_of", "run_all"]

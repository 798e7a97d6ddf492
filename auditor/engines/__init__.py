"""Many recordings, one after the other or at the same time."""

from auditor.engines.processes import Outcome, Progress, run_all

__all__ = ["Outcome", "Progress", "run_all"]

"""SEE: a frame becomes disparity maps, and those become counts of inconsistent pixels."""

from auditor.evidence.measuring import Evidence, measure

__all__ = ["Evidence", "measure"]

"""SEE: a frame becomes disparity maps, and those become counts of inconsistent pixels."""

from auditor.evidence.measuring import Evidence, measure
from auditor.evidence.pictures import Picture, draw

__all__ = ["Evidence", "Picture", "draw", "measure"]

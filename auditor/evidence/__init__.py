"""SEE: a frame becomes disparity maps, and those become counts of inconsistent pixels."""

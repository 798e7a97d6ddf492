"""Point clouds as PLY files, which every viewer of clouds opens."""

import numpy as np

from auditor.model.arrays import Mask, Points

_RED, _GREY = (255, 40, 40), (150, 150, 150)
_VERTEX = np.dtype([("xyz", "<f4", 3), ("colour", "u1", 3), ("damaged", "u1")])


def ply(points: Points, damaged: Mask) -> bytes:
    """A binary PLY file of (N, 3) points in metres; (N,) `damaged` ones are red and have `damaged` 1."""
    vertices = np.zeros(len(points), dtype=_VERTEX)
    vertices["xyz"] = points
    vertices["colour"] = np.where(damaged[:, None], _RED, _GREY)
    vertices["damaged"] = damaged
    header = (
        "ply",
        "format binary_little_endian 1.0",
        "comment metres in the frame of the LiDAR: see damaged",
        f"element vertex {len(points)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue", "damaged")),
        "end_header\n",
    )
    return "\n".join(header).encode() + vertices.tobytes()

"""Regions as rows of the table `regions`, and back."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from auditor.regions import Region, Solid
from auditor.store.tables import Row, stream_rows

_BOX = ("left_px", "top_px", "right_px", "bottom_px")


def region_rows(measurement_id: str, frame: int, regions: Iterable[Region]) -> Iterator[Row]:
    """The rows of one frame."""
    for region in regions:
        solid = region.solid
        yield {
            "measurement_id": measurement_id,
            "frame": frame,
            "sensor": region.sensor,
            "view": region.view,
            **dict(zip(_BOX, region.box_px, strict=True)),
            "share": region.share,
            "mask": region.mask,
            "points": region.points,
            "centre_m": list(solid.centre_m) if solid else None,
            "size_m": list(solid.size_m) if solid else None,
            "yaw_deg": solid.yaw_deg if solid else None,
        }


def read_regions(path: Path, frame: int) -> list[Region]:
    """The regions of one frame; none where the measurement is older than regions. Raises StoreError."""
    rows = stream_rows("regions", path) if path.is_file() else ()
    return [_region(row) for row in rows if row["frame"] == frame]


def _region(row: Mapping[str, Any]) -> Region:
    solid = None
    if row["centre_m"] is not None:
        solid = Solid(tuple(row["centre_m"]), tuple(row["size_m"]), row["yaw_deg"])
    left, top, right, bottom = (row[name] for name in _BOX)
    box = left, top, right, bottom
    return Region(row["sensor"], row["view"], box, row["share"], row["mask"], row["points"], solid)

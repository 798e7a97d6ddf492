"""Pictures of the strongest frames, so that a report needs no recording: `pictures/<measurement_id>/<frame>`."""

from dataclasses import dataclass
from pathlib import Path

from auditor.store.files import checked_id, write_whole


@dataclass(frozen=True)
class Picture:
    """The reference image of a frame and its inconsistent pixels, as small files ready to be shown."""

    frame: int
    jpeg: bytes
    mask_png: bytes


def write_picture(folder: Path, measurement_id: str, picture: Picture) -> None:
    """Keep the picture of a frame. Raises StoreError."""
    jpeg, mask = _paths(folder, measurement_id, picture.frame)
    write_whole(jpeg, picture.jpeg)
    write_whole(mask, picture.mask_png)


def read_picture(folder: Path, measurement_id: str, frame: int) -> Picture | None:
    """The picture of a frame; None where none was kept."""
    jpeg, mask = _paths(folder, measurement_id, frame)
    if not (jpeg.is_file() and mask.is_file()):
        return None
    return Picture(frame, jpeg.read_bytes(), mask.read_bytes())


def pictured_frames(folder: Path, measurement_id: str) -> list[int]:
    """The frames of a measurement whose pictures were kept, ascending."""
    masks = (folder / checked_id(measurement_id)).glob("*.png")
    return sorted(int(mask.stem) for mask in masks if mask.stem.isdigit() and mask.with_suffix(".jpg").is_file())


def _paths(folder: Path, measurement_id: str, frame: int) -> tuple[Path, Path]:
    stem = folder / checked_id(measurement_id) / str(int(frame))
    return stem.with_suffix(".jpg"), stem.with_suffix(".png")

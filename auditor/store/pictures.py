"""Pictures of the strongest frames, so that a report needs no recording: `pictures/<measurement_id>/<frame>_S<k>.*`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from auditor.store.files import Written, checked_id, write_whole

_MASK = re.compile(r"(\d+)_S(\d+)\.png")
_VIEW = re.compile(r"(\d+)_S(\d+)\.jpg")


@dataclass(frozen=True)
class Picture:
    """One frame as small files ready to be shown: what each camera saw (JPEG), by sensor.

    `mask_png` holds the inconsistent pixels, transparent elsewhere, and lies over the view of the `reference` camera.
    """

    frame: int
    reference: int
    views: Mapping[int, bytes]
    mask_png: bytes


def write_picture(folder: Path, measurement_id: str, picture: Picture) -> tuple[Written, ...]:
    """Keep the picture of a frame; its mask comes last and makes it finished. Raises StoreError."""
    pictures = folder / checked_id(measurement_id)
    views = [write_whole(pictures / f"{picture.frame}_S{sensor}.jpg", jpeg) for sensor, jpeg in picture.views.items()]
    return *views, write_whole(pictures / f"{picture.frame}_S{picture.reference}.png", picture.mask_png)


def read_picture(folder: Path, measurement_id: str, frame: int) -> Picture | None:
    """The picture of a frame; None where none was kept."""
    pictures = folder / checked_id(measurement_id)
    for mask in pictures.glob(f"{int(frame)}_S*.png"):
        if found := _MASK.fullmatch(mask.name):
            views = {
                int(view[2]): path.read_bytes()
                for path in sorted(pictures.glob(f"{int(frame)}_S*.jpg"))
                if (view := _VIEW.fullmatch(path.name))
            }
            return Picture(frame, int(found[2]), views, mask.read_bytes())
    return None


def pictured_frames(folder: Path, measurement_id: str) -> list[int]:
    """The frames of a measurement whose pictures were kept, ascending."""
    masks = (_MASK.fullmatch(path.name) for path in (folder / checked_id(measurement_id)).glob("*.png"))
    return sorted(int(mask[1]) for mask in masks if mask)


def picture_files(folder: Path) -> list[str]:
    """The files of all pictures, as paths within the folder of the store that their folder is part of."""
    folders = sorted(folder.iterdir()) if folder.is_dir() else []
    return [f"{folder.name}/{one.name}/{file.name}" for one in folders if one.is_dir() for file in one.iterdir()]

"""Pictures of frames, so that a report needs no recording.

While measuring, small ones of the strongest frames are kept: `pictures/<measurement_id>/<frame>_S<k>.*`. Once frames
are judged, those that show incidents are kept at full resolution: `<frame>_S<k>.<content>.*` beside them.
"""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

from auditor.model.pictures import Content, FramePicture, Picture
from auditor.store.files import WrittenFile, checked_id, write_whole
from auditor.store.log.entry import OutputFile
from auditor.store.log.runs import Run

_MASK = re.compile(r"(\d+)_S(\d+)\.png")
_VIEW = re.compile(r"(\d+)_S(\d+)\.jpg")
_FULL = re.compile(rf"(\d+)_S(\d+)\.({'|'.join(Content)})\.(jpg|png)")


def write_picture(folder: Path, measurement_id: str, picture: Picture) -> tuple[WrittenFile, ...]:
    """Keep the picture of a frame; its mask comes last and makes it finished. Raises StoreError."""
    pictures = folder / checked_id(measurement_id)
    views = [write_whole(pictures / f"{picture.frame}_S{sensor}.jpg", jpeg) for sensor, jpeg in picture.views.items()]
    return *views, write_whole(pictures / f"{picture.frame}_S{picture.reference}.png", picture.mask_png)


def read_picture(folder: Path, measurement_id: str, frame: int) -> Picture | None:
    """The picture of a frame; None where none was kept."""
    pictures = folder / checked_id(measurement_id)
    for mask in pictures.glob(f"{int(frame)}_S*.png"):
        if name := _MASK.fullmatch(mask.name):
            views = {
                int(view[2]): path.read_bytes()
                for path in sorted(pictures.glob(f"{int(frame)}_S*.jpg"))
                if (view := _VIEW.fullmatch(path.name))
            }
            return Picture(frame, int(name[2]), views, mask.read_bytes())
    return None


def pictured_frames(folder: Path, measurement_id: str) -> list[int]:
    """The frames of a measurement whose pictures were kept, ascending."""
    masks = (_MASK.fullmatch(path.name) for path in (folder / checked_id(measurement_id)).glob("*.png"))
    return sorted(int(mask[1]) for mask in masks if mask)


def write_frame_pictures(run: Run, measurement_id: str, pictures: Sequence[FramePicture]) -> None:
    """Keep pictures of frames at full resolution; the log tells of them before they are there. Raises StoreError."""
    folder = run.folder / "pictures" / checked_id(measurement_id)
    files = {folder / picture.name: picture.data for picture in pictures}
    told = [WrittenFile(path, len(data), hashlib.sha256(data).hexdigest()) for path, data in files.items()]
    with run.writing([OutputFile.of_written(one, run.folder) for one in told]):
        for path, data in files.items():
            write_whole(path, data)


def full_pictures(folder: Path, measurement_id: str, frame: int | None = None) -> list[Path]:
    """The files of the pictures at full resolution of a measurement, or of one of its frames, by frame and sensor."""
    beginning = "" if frame is None else f"{int(frame)}_S"
    files = (folder / checked_id(measurement_id)).glob(f"{beginning}*")
    named = {path: name for path in files if (name := _FULL.fullmatch(path.name))}
    return sorted(named, key=lambda path: (int(named[path][1]), int(named[path][2]), path.name))


def pictured_in_full(folder: Path, measurement_id: str) -> set[int]:
    """The frames of a measurement that have pictures at full resolution."""
    return {int(path.name.partition("_")[0]) for path in full_pictures(folder, measurement_id)}


def read_frame_pictures(folder: Path, measurement_id: str, frame: int) -> list[FramePicture]:
    """The pictures of a frame at full resolution; none where none were kept."""
    pictures = []
    for path in full_pictures(folder, measurement_id, frame):
        name = _FULL.fullmatch(path.name)
        assert name is not None
        pictures.append(FramePicture(frame, int(name[2]), Content(name[3]), name[4], path.read_bytes()))
    return pictures


def picture_files(folder: Path) -> list[str]:
    """The files of all pictures, as paths within the folder of the store that their folder is part of."""
    folders = sorted(folder.iterdir()) if folder.is_dir() else []
    return [f"{folder.name}/{one.name}/{file.name}" for one in folders if one.is_dir() for file in one.iterdir()]

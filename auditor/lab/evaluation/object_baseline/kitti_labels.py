"""KITTI's object labels, in the formats of its object and its tracking benchmark."""

import hashlib
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from auditor.errors import SettingError

_OBJECT_FIELDS = 15
_TRACKING_FIELDS = 17
_MOST_BYTES = 256 * 2**20


@dataclass(frozen=True)
class ObjectLabel:
    """One labelled object.

    `truncated` is the share outside the image, in tracking labels a level; `occluded` a level, 0 fully visible.
    `box_px` is left, top, right, bottom in the image of the leftmost camera; `size_m` height, width, length; `place_m`
    the centre of the underside in the rig frame (x right, y down, z forward); `yaw_rad` turns x towards -z.
    """

    kind: str
    truncated: float
    occluded: int
    box_px: tuple[float, float, float, float]
    size_m: tuple[float, float, float]
    place_m: tuple[float, float, float]
    yaw_rad: float


@dataclass(frozen=True, eq=False)
class LabelledDrive:
    """The objects of each labelled frame, by number; `content` is the hash of the files."""

    frames: Mapping[int, tuple[ObjectLabel, ...]]
    content: str


def read_object_labels(folder: Path, recording: str) -> LabelledDrive:
    """The labels of a recording, found by its name without ending.

    `FOLDER/<name>.txt` is a file of the tracking benchmark, `FOLDER/<name>/` and else FOLDER itself hold a file a frame
    as in the object benchmark, named by its number. Raises SettingError where there are none, or one cannot be read.
    """
    name = Path(recording).stem
    if (tracking := folder / f"{name}.txt").is_file():
        text = _read(tracking)
        return LabelledDrive(_tracking(text, tracking), _hash([text]))
    within = folder / name if (folder / name).is_dir() else folder
    files = {int(path.stem): path for path in sorted(within.glob("*.txt")) if path.stem.isdecimal()}
    if not files:
        raise SettingError(
            f"there are no labels of {name!r}", where=folder, remedy=f"put them into {name}.txt or {name}/000000.txt"
        )
    texts = {number: _read(path) for number, path in sorted(files.items())}
    frames = {number: _objects(text, files[number]) for number, text in texts.items()}
    return LabelledDrive(frames, _hash(f"{number}\n{text}" for number, text in texts.items()))


def _tracking(text: str, path: Path) -> dict[int, tuple[ObjectLabel, ...]]:
    """All frames up to the last with an object are labelled, those without a line as empty."""
    labels: dict[int, list[ObjectLabel]] = defaultdict(list)
    for number, fields in _lines(text, path, _TRACKING_FIELDS):
        try:
            frame = int(fields[0])
        except ValueError as error:
            raise _unreadable(path, number, error) from error
        if 0 <= frame < 1_000_000:
            labels[frame].append(_label(fields[2:], path, number))
    return {frame: tuple(labels.get(frame, ())) for frame in range(max(labels, default=-1) + 1)}


def _objects(text: str, path: Path) -> tuple[ObjectLabel, ...]:
    return tuple(_label(fields, path, number) for number, fields in _lines(text, path, _OBJECT_FIELDS))


def _lines(text: str, path: Path, least: int) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if fields and len(fields) < least:
            raise _unreadable(path, number, f"{len(fields)} fields in place of {least}")
        if fields:
            yield number, fields


def _label(fields: Sequence[str], path: Path, number: int) -> ObjectLabel:
    try:
        values = [float(field) for field in fields[1:_OBJECT_FIELDS]]
    except ValueError as error:
        raise _unreadable(path, number, error) from error
    if not all(map(math.isfinite, values)):
        raise _unreadable(path, number, "a number that is not finite")
    truncated, occluded, _alpha, left, top, right, bottom, height, width, length, x, y, z, yaw = values
    size, place = (height, width, length), (x, y, z)
    return ObjectLabel(fields[0], truncated, int(occluded), (left, top, right, bottom), size, place, yaw)


def _read(path: Path) -> str:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SettingError("it is too large for a file of labels", where=path)
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SettingError(f"it is not a readable file of labels ({error})", where=path) from error


def _hash(texts: Iterator[str] | Sequence[str]) -> str:
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode())
        digest.update(b"\0")
    return digest.hexdigest()


def _unreadable(path: Path, line: int, why: object) -> SettingError:
    return SettingError(
        f"line {line} is not a label of KITTI's ({why})", where=path, remedy="give label_2 or label_02 files"
    )

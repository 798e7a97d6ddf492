"""The frames that show an incident, with their pictures at full resolution, as a page has them."""

import base64
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from auditor.model.pictures import Content
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store

_EXAMPLES = """
    SELECT example.*, recordings.name
    FROM incident_examples AS example
    JOIN measurements USING (measurement_id)
    JOIN recordings USING (recording_id)
"""
_ORDER = ("strongest", "before", "after", "clean")
_CONTENTS = tuple(Content)
_SHOWS = {
    Content.COLOUR: "as recorded",
    Content.OVERLAY: "with what is damaged",
    Content.ABOVE: "the cloud from above",
    Content.RANGE: "the cloud as a range image",
}
_BLURRED = "blurred"
_MEDIA_TYPES = {"jpg": "image/jpeg", "png": "image/png", "svg": "image/svg+xml"}


@dataclass(frozen=True)
class Example:
    """A frame that shows an incident: `what` says what it is to it, in the words of the view `incident_examples`.

    A frame may be several things: the one before an incident is often the nearest clean one. `name` is its recording's.
    """

    what: tuple[str, ...]
    measurement_id: str
    frame: int
    stamp_ns: int
    name: str


@dataclass(frozen=True)
class ShownPicture:
    """One picture: its address, a data URI or a place beside the page, the sensor, and what of it is shown."""

    address: str
    sensor: int
    content: Content
    blurred: bool = False

    @property
    def shows(self) -> str:
        """The same in words."""
        return _BLURRED if self.blurred and self.content is Content.COLOUR else _SHOWS[self.content]


@dataclass(frozen=True)
class ShownExample:
    """An example with its pictures, in order."""

    example: Example
    pictures: tuple[ShownPicture, ...]

    @property
    def words(self) -> str:
        """What the frame is to the incident."""
        said = {
            "strongest": "its strongest frame",
            "before": "before it",
            "after": "after it",
            "clean": "the nearest clean frame",
        }
        return " and ".join(said[one] for one in self.example.what)


def examples_of(store: Store, incident_id: str | None = None) -> dict[str, tuple[Example, ...]]:
    """The frames that show incidents, by the ids of these: of one, or of all. Raises StoreError."""
    where = "" if incident_id is None else f" WHERE incident_id = '{incident_id}'"
    examples: dict[str, dict[tuple[str, int], Example]] = {}
    for row in sorted(rows_of(run_sql(store, _EXAMPLES + where)), key=_place):
        frames = examples.setdefault(row["incident_id"], {})
        key = row["measurement_id"], row["frame"]
        reasons = (*(frames[key].what if key in frames else ()), row["example"])
        frames[key] = Example(reasons, *key, row["stamp_ns"], row["name"])
    return {known: tuple(frames.values()) for known, frames in examples.items()}


def kept_examples(store: Store, examples: Iterable[Example]) -> tuple[ShownExample, ...]:
    """The examples of which the store keeps pictures, with these inside the page."""
    shown = []
    for example in examples:
        pictures = store.frame_pictures(example.measurement_id, example.frame)
        if pictures:
            listed = (ShownPicture(data_uri(each.form, each.data), each.sensor, each.content) for each in pictures)
            shown.append(ShownExample(example, in_order(listed)))
    return tuple(shown)


def in_order(pictures: Iterable[ShownPicture]) -> tuple[ShownPicture, ...]:
    """Pictures of a frame: those of the cameras from right to left, then those of the clouds, first from above."""
    return tuple(sorted(pictures, key=_rank))


def _rank(picture: ShownPicture) -> tuple[bool, int, int, int]:
    of_cloud, content = picture.content in (Content.ABOVE, Content.RANGE), _CONTENTS.index(picture.content)
    return of_cloud, content if of_cloud else picture.sensor, content, picture.sensor


def data_uri(form: str, data: bytes) -> str:
    """A picture of the form jpg, png or svg as a page holds it."""
    return f"data:{_MEDIA_TYPES[form]};base64,{base64.b64encode(data).decode()}"


def _place(row: Mapping[str, Any]) -> int:
    return _ORDER.index(row["example"])

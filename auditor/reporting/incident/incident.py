"""One incident of a store, as its page and its case show it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from auditor.model.rig import Rig
from auditor.reporting.incident.examples import Example, examples_of
from auditor.store.records import RecordingRecord
from auditor.store.store import Store


@dataclass(frozen=True, eq=False)
class Incident:
    """One incident; `row` is that of the view `incidents`.

    It may run through several recordings: all that comes from a recording is of the `part` that has the strongest
    frame.
    """

    store: Store
    row: Mapping[str, Any]

    @property
    def incident_id(self) -> str:
        """Its whole id."""
        return str(self.row["incident_id"])

    @property
    def attacked(self) -> tuple[int, ...]:
        """The attacked sensors; none where none is named."""
        return tuple(self.row["attacked"])

    @cached_property
    def part(self) -> Mapping[str, Any]:
        """What the recording with the strongest frame has of it."""
        strongest = self.row["strongest_measurement_id"] or self.row["measurement_id"]
        [part] = [part for part in self.row["parts"] if part["measurement_id"] == strongest]
        return dict(part)

    @property
    def measurement_id(self) -> str:
        """The measurement that the pictures and the clip follow."""
        return str(self.part["measurement_id"])

    @cached_property
    def recording(self) -> RecordingRecord:
        """The recording with the strongest frame."""
        return self.store.recording(self.part["recording_id"])

    @property
    def rig(self) -> Rig:
        """The rig as it was measured with."""
        return self.store.rig(self.store.measurement(self.measurement_id).rig_id)

    @cached_property
    def examples(self) -> tuple[Example, ...]:
        """The frames that show it, the strongest first; some may be of other recordings of its drive."""
        return examples_of(self.store, self.incident_id).get(self.incident_id, ())

    @property
    def strongest(self) -> int | None:
        """Its strongest frame."""
        return next((example.frame for example in self.examples if "strongest" in example.what), None)

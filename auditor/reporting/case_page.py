"""The first page of a case: what is in its folder, what it lacks and why, its pictures, and how to check it."""

from dataclasses import dataclass

from auditor.reporting.templates import fill


@dataclass(frozen=True)
class PictureLine:
    """One picture: its place in the folder, what its frame is to the incident, the frame, the sensor, and its words."""

    file: str
    example: str
    frame: int
    sensor: int
    shows: str


@dataclass(frozen=True)
class CasePage:
    """What the page shows; `words` is the evidence, `remarks` what the case lacks."""

    title: str
    auditor_version: str
    incident_id: str
    words: str
    remarks: tuple[str, ...]
    pictures: tuple[PictureLine, ...]
    has_place: bool
    files: tuple[str, ...]

    @property
    def frames(self) -> list[tuple[int, str]]:
        """The pictured frames, each with what it is to the incident, the strongest first."""
        there = {(one.frame, one.example) for one in self.pictures}
        return sorted(there, key=lambda one: (one[1] != "strongest", one[1] == "clean", one[0]))

    def of_frame(self, frame: int) -> list[PictureLine]:
        """The pictures of a frame: those of the cameras from right to left, then those of the cloud."""
        return sorted(
            (one for one in self.pictures if one.frame == frame), key=lambda one: (not one.sensor, one.sensor, one.file)
        )


def render_case(page: CasePage) -> str:
    """The page as HTML. All of its text is escaped; it refers to files of its folder alone."""
    return fill("case.html", {"page": page})

"""What the incident page shows, with everything it needs: the template reads these and nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal

from auditor.model.checks.words import found_of
from auditor.model.coverage import TopicCoverage, TopicState, coverage_line, not_compared_line, unread_line
from auditor.model.frames import TopicBalance
from auditor.model.measurement import Solid
from auditor.model.pictures import DAMAGED_COLOUR, LIDAR_COLOURS
from auditor.model.rig import Triple
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS, VerdictKind
from auditor.reporting.incident.cameras_beside import Beside, NamedByPast
from auditor.reporting.incident.contradictions import Contradiction
from auditor.reporting.incident.examples import ShownExample
from auditor.reporting.incident.provenance import Provenance
from auditor.reporting.plots import Figure

EDGE = "edge"


@dataclass(frozen=True)
class Clock:
    """How stamps of one recording are shown: as UTC, or as seconds after its first frame."""

    origin_ns: int
    utc: bool

    def moment(self, stamp_ns: int) -> str:
        """A point in time, to the millisecond."""
        if not self.utc:
            return f"{self.seconds(stamp_ns):.3f} s after the first frame"
        return f"{self._utc(stamp_ns):%Y-%m-%d %H:%M:%S}.{stamp_ns % NANOSECONDS // 1_000_000:03d} UTC"

    def brief(self, stamp_ns: int) -> str:
        """The same for a table, whose note gives what t counts from."""
        return self.moment(stamp_ns) if self.utc else f"t = {self.seconds(stamp_ns):.3f} s"

    def seconds(self, stamp_ns: int) -> float:
        """Seconds after the recording's first frame."""
        return (stamp_ns - self.origin_ns) / NANOSECONDS

    def _utc(self, stamp_ns: int) -> datetime:
        return datetime.fromtimestamp(stamp_ns // NANOSECONDS, UTC)


@dataclass(frozen=True)
class SensorLine:
    """One sensor: what the recording calls it, in how many frames it was there, and the medians of its coverage.

    `what` it is: LiDAR or camera.
    """

    number: int
    name: str
    topic: str
    what: str
    present: int = 0
    missing: int = 0
    damaged: int = 0
    saturated_share: float | None = None
    textureless_share: float | None = None
    returns: float | None = None
    compared_share: float | None = None
    compared_by_two_share: float | None = None


@dataclass(frozen=True)
class DamagedPortion:
    """The damaged portion of a sensor in a view of so many pixels: `mask` is a data URI of a PNG, white where damaged.

    `box_px` is (left, top, right, bottom); `points` and `solid` are the LiDAR's.
    """

    sensor: int
    width_px: int
    height_px: int
    mask: str
    box_px: tuple[int, int, int, int]
    share: float
    points: int | None = None
    solid: Solid | None = None


@dataclass(frozen=True)
class PageView:
    """One camera's picture of one frame, as data URIs.

    `mask` lies over it where it is the reference camera's, `portions` where sensors were attacked.
    """

    sensor: int
    frame: int
    picture: str
    mask: str | None = None
    portions: tuple[DamagedPortion, ...] = ()


@dataclass(frozen=True)
class Truth:
    """A ground-truth label; `sensor` is None where the rig does not use its topic."""

    sensor: int | None
    topic: str
    attack: str
    from_ns: int
    to_ns: int
    parameters: Mapping[str, object]


@dataclass(frozen=True)
class EvidenceLine:
    """What a check of a sensor was in an incident: in how many frames it exceeded the limit, and its z there.

    `other` is the second camera where two alone do not see the same.
    """

    check: str
    sensor: int
    other: int | None
    frames: int
    mean: float
    largest: float

    @property
    def found(self) -> str:
        """What the check says where it fires."""
        return found_of(self.check, by_two=self.other is not None)


@dataclass(frozen=True)
class IncidentPart:
    """A run of frames with the same finding, as far as it lies in one recording: part `part` of `parts`.

    `evidence`, `alternatives` and `causes` are in words, of the whole incident. `checks` is the evidence of this part
    by sensor and check, of the robust method. `states` and `reasons` are its e vectors and what the verdicts add, each
    with its number of frames. `figure` is None where the incident is listed but not drawn. `shown` are frames that
    show it at full resolution, `views` what measuring kept, where there are none of these. `contradictions` are what
    LiDARs without cameras contradict of each other, and `beside` is what cameras say of one of them. `named_by_pasts`
    is what cameras that are compared with their own past name, where the incident names no sensor.
    """

    number: int
    incident_id: str
    kind: VerdictKind
    attacked: tuple[int, ...]
    first_frame: int
    last_frame: int
    frames: int
    from_ns: int
    to_ns: int
    grade: str = "incident"
    part: int = 1
    parts: int = 1
    evidence: str = ""
    alternatives: str = ""
    causes: str = ""
    checks: tuple[EvidenceLine, ...] = ()
    states: tuple[tuple[str, int], ...] = ()
    reasons: tuple[tuple[str, int], ...] = ()
    figure: Figure | None = None
    views: tuple[PageView, ...] = ()
    shown: tuple[ShownExample, ...] = ()
    contradictions: tuple[Contradiction, ...] = ()
    beside: tuple[Beside, ...] = ()
    named_by_pasts: tuple[NamedByPast, ...] = ()

    @property
    def contested(self) -> Contradiction | None:
        """What another LiDAR contradicts in most frames."""
        return next((one for one in self.contradictions if one.others), None)

    @property
    def contradictory(self) -> tuple[int, ...]:
        """The LiDARs that contradict each other."""
        return tuple(sorted({sensor for one in self.contradictions for sensor in (one.sensor, *one.others)}))

    @property
    def duration_s(self) -> float:
        """Time from its first frame to its last."""
        return (self.to_ns - self.from_ns) / NANOSECONDS


@dataclass(frozen=True)
class LabelAgreement:
    """Verdicts against ground truth: of `labelled` frames, those attributed exactly; of the others, those raised."""

    labelled: int
    exact: int
    unlabelled: int
    raised: int


@dataclass(frozen=True)
class Remark:
    """What the verdicts on frames without a finding add: why they could not be audited, or without which sensors."""

    kind: VerdictKind
    reason: str
    frames: int


@dataclass(frozen=True)
class RecordingPart:
    """One recording: its sensors, its balance, its verdicts and its incidents.

    `told` are its frames in incidents and alerts, `alone` those with a finding that belong to none: too little before
    and after them says the same. `other_names` and `paths` are those that its content was read under; `superseded_by`
    and `conflicts` name other recordings: one that holds every frame of this one, and those with other data at the same
    stamps. `rig_picture` is a data URI of its rig from above.
    """

    recording_id: str
    name: str
    vehicle: str | None
    date: str | None
    drive: str | None
    damage: tuple[str, ...]
    clock: Clock
    measured: int
    to_ns: int
    verdicts: Mapping[VerdictKind, int]
    skipped: Mapping[str, int]
    sensors: tuple[SensorLine, ...]
    triples: tuple[Triple, ...]
    balance: tuple[TopicBalance, ...]
    provenance: Provenance
    told: int = 0
    alone: int = 0
    incidents: tuple[IncidentPart, ...] = ()
    overview: Figure | None = None
    truths: tuple[Truth, ...] = ()
    agreement: LabelAgreement | None = None
    remarks: tuple[Remark, ...] = ()
    other_names: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    superseded_by: tuple[str, ...] = ()
    conflicts: tuple[str, ...] = ()
    covered: tuple[TopicCoverage, ...] = ()
    rig_picture: str = ""

    @property
    def reading(self) -> tuple[str, ...]:
        """What counts against the coverage, and which sensors cannot be read, or are not compared: one line each."""
        lines = (coverage_line(self.covered), unread_line(self.covered), not_compared_line(self.covered))
        return tuple(filter(None, lines))

    @property
    def outside(self) -> tuple[TopicCoverage, ...]:
        """Topics of camera pictures or LiDAR points that were not audited."""
        return tuple(topic for topic in self.covered if topic.state is not TopicState.READ)

    @property
    def judged(self) -> int:
        """Frames that have a verdict, of any kind."""
        return sum(self.verdicts.values())

    @property
    def audited(self) -> int:
        """Frames whose verdict is one about attacks: all but not_auditable."""
        return self.judged - self.verdicts.get(VerdictKind.NOT_AUDITABLE, 0)

    @property
    def raised(self) -> int:
        """Frames with a finding."""
        return sum(count for kind, count in self.verdicts.items() if kind in FINDINGS)

    @property
    def edge(self) -> int:
        """Ticks within one period of the recording's start and end, where some sensor had not begun or had ended."""
        return self.skipped.get(EDGE, 0)

    @property
    def lost(self) -> Mapping[str, int]:
        """Ticks without a frame by reason, those at the edges left out."""
        return {reason: count for reason, count in self.skipped.items() if reason != EDGE}

    @property
    def frames(self) -> int:
        """All frames, the lost ones included, those at the edges not."""
        return self.measured + sum(self.lost.values())

    @property
    def coverage(self) -> float | None:
        """Share of all frames that were audited; None where there are none."""
        return self.audited / self.frames if self.frames else None

    @property
    def skipped_messages(self) -> int:
        """Messages of all topics that were skipped."""
        return sum(sum(topic.skipped.values()) for topic in self.balance)

    @property
    def damaged_colour(self) -> str:
        """That of damaged points in pictures from above, in hexadecimal digits."""
        return DAMAGED_COLOUR

    @property
    def lidars(self) -> tuple[tuple[SensorLine, str], ...]:
        """Its LiDARs, each with its colour in pictures of all of them, in hexadecimal digits."""
        lidars = (sensor for sensor in self.sensors if sensor.what == "LiDAR")
        return tuple(zip(lidars, LIDAR_COLOURS, strict=False))

    def sensor(self, number: int) -> SensorLine:
        """The sensor of a number."""
        return next(sensor for sensor in self.sensors if sensor.number == number)

    @property
    def max_attacked(self) -> int:
        """How many attacked sensors can be identified at once: N - 3."""
        return max(len(self.sensors) - 3, 0)


@dataclass(frozen=True)
class IncidentPage:
    """The whole page."""

    made_at: str
    auditor_version: str
    store: str
    recordings: tuple[RecordingPart, ...]

    @property
    def incidents(self) -> tuple[tuple[RecordingPart, IncidentPart], ...]:
        """All incidents, those with named sensors first, then the longest."""
        pairs = [(recording, incident) for recording in self.recordings for incident in recording.incidents]
        return tuple(sorted(pairs, key=lambda pair: (not pair[1].attacked, -pair[1].frames)))

    @property
    def listed_count(self) -> int:
        """Incidents and alerts, each once through however many recordings it runs."""
        return len({incident.number for _, incident in self.incidents})

    @property
    def alert_count(self) -> int:
        """Those that are alerts."""
        return len({incident.number for _, incident in self.incidents if incident.grade == "alert"})

    @property
    def incident_count(self) -> int:
        """Those that are incidents."""
        return self.listed_count - self.alert_count

    @property
    def recordings_by_gravity(self) -> tuple[RecordingPart, ...]:
        """The recordings, those with the most frames raised first."""
        return tuple(sorted(self.recordings, key=lambda recording: -recording.raised))

    @property
    def frames(self) -> int:
        """All frames, the skipped ones included."""
        return sum(recording.frames for recording in self.recordings)

    @property
    def judged(self) -> int:
        """Frames that have a verdict."""
        return sum(recording.judged for recording in self.recordings)

    @property
    def audited(self) -> int:
        """Frames whose verdict is one about attacks: all but not_auditable."""
        return sum(recording.audited for recording in self.recordings)

    @property
    def raised(self) -> int:
        """Frames with a finding."""
        return sum(recording.raised for recording in self.recordings)

    @property
    def coverage(self) -> float | None:
        """Share of all frames, the skipped ones included, that were audited; None where there are none."""
        return self.audited / self.frames if self.frames else None

    @property
    def duration_s(self) -> float:
        """Time between the first and the last frame, over all recordings."""
        return sum(recording.clock.seconds(recording.to_ns) for recording in self.recordings)

    @property
    def rates(self) -> tuple[Decimal, ...]:
        """The designated false-alarm rates r that were judged at."""
        rates = (recording.provenance.r for recording in self.recordings)
        return tuple(sorted({r for r in rates if r is not None}))

    @property
    def methods(self) -> frozenset[str]:
        """The methods that recordings were judged by."""
        return frozenset(recording.provenance.method for recording in self.recordings if recording.provenance.method)

    @property
    def resolvable(self) -> bool:
        """False where some r is below 1/N."""
        return all(recording.provenance.resolvable for recording in self.recordings)

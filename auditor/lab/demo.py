"""The recordings of `auditor demo`: a small fleet, rendered and attacked, for a first audit without own data."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.lab.attacks.schedule import Attacker, AttackPlan
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR
from auditor.model.verdict import AttackLabel
from auditor.recordings import write_bag, write_db3, write_mcap

_START_NS = 1_767_600_000 * 10**9  # an evening in January 2026, UTC
_TEN_MINUTES_NS = 600 * 10**9
_WRITERS = {".mcap": write_mcap, ".bag": write_bag, ".db3": write_db3}


@dataclass(frozen=True)
class DemoVehicle:
    """A vehicle of the fleet: its name, and the seed of its sensors' flaws."""

    name: str
    number: int


@dataclass(frozen=True)
class Take:
    """One recording of the demo: a drive along a street of its own, with one sensor attacked or none.

    `attacked_frames` count from the recording's first.
    """

    file: Path
    vehicle: DemoVehicle
    street: int
    style: str
    attacked: int | None = None
    attacked_frames: range = range(0)

    def __str__(self) -> str:
        return self.file.name


_ALDER, _BIRCH, _CEDAR = DemoVehicle("alder", 1), DemoVehicle("birch", 2), DemoVehicle("cedar", 3)
_FRAMES = 14
_HIT = range(4, 11)


def fleet(folder: Path) -> tuple[tuple[Take, ...], tuple[Take, ...]]:
    """The clean recordings of the vehicles, and later ones on other streets, some of them attacked."""
    clean = (
        Take(folder / "alder_day.mcap", _ALDER, 2001, "residential"),
        Take(folder / "birch_day.bag", _BIRCH, 2002, "city"),
        Take(folder / "cedar_day.db3", _CEDAR, 2003, "residential"),
    )
    suspected = (
        Take(folder / "alder_evening.mcap", _ALDER, 2011, "city"),
        Take(folder / "alder_night.mcap", _ALDER, 2012, "city", attacked=3, attacked_frames=_HIT),
        Take(folder / "birch_night.mcap", _BIRCH, 2013, "residential", attacked=1, attacked_frames=_HIT),
        Take(folder / "cedar_night.bag", _CEDAR, 2014, "city", attacked=LIDAR, attacked_frames=_HIT),
    )
    return clean, suspected


def record(take: Take, progress: Callable[[str, int], None]) -> Path:
    """Render a take and write it with the real writer of its format. Raises RecordingError."""
    drive = make_drive(
        take.street,
        _FRAMES,
        style=take.style,
        vehicle=take.vehicle.number,
        start_ns=_START_NS + take.street % 100 * _TEN_MINUTES_NS,
    )
    attackers = []
    if take.attacked is not None:
        first, last = (drive.start_ns + take.attacked_frames[at] * 10**8 for at in (0, -1))
        attackers.append(Attacker(AttackPlan(take.attacked, seed=take.street, from_ns=first, to_ns=last), drive.rig))
    _WRITERS[take.file.suffix](
        take.file,
        drive.rig,
        _frames(drive, take, attackers, progress),
        _labels(attackers),
        vehicle=take.vehicle.name,
        place=drive.place,
    )
    return take.file


def _frames(
    drive: SyntheticDrive, take: Take, attackers: list[Attacker], progress: Callable[[str, int], None]
) -> Iterator[Frame]:
    for done, frame in enumerate(drive.frames(), start=1):
        changed = frame
        for attacker in attackers:
            changed = _attacked(changed, attacker)
        yield changed
        progress(str(take), done)


def _attacked(frame: Frame, attacker: Attacker) -> Frame:
    sensor = attacker.plan.sensor
    if sensor != LIDAR:
        return replace(frame, images={**frame.images, sensor: attacker.change_image(frame.images[sensor])})
    assert frame.cloud is not None
    return replace(frame, cloud=attacker.change_cloud(frame.cloud))


def _labels(attackers: list[Attacker]) -> Iterator[AttackLabel]:
    """Read after the frames: only then are the labels known."""
    yield from (attacker.label for attacker in attackers if attacker.label is not None)

"""A small fleet, made and attacked here, so that a newcomer sees a whole audit without any data of their own."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.frames import Frame
from auditor.lab.drives import SyntheticDrive, make_drive
from auditor.lab.plans import Attacker, AttackPlan
from auditor.recordings import write_bag, write_db3, write_mcap
from auditor.results import AttackLabel
from auditor.rig import LIDAR

_START_NS = 1_767_600_000 * 10**9  # an evening in January 2026, UTC
_WRITERS = {".mcap": write_mcap, ".bag": write_bag, ".db3": write_db3}


@dataclass(frozen=True)
class Street:
    """A street that one vehicle of the fleet drives along."""

    vehicle: str
    number: int
    seed: int
    style: str
    frames: int


@dataclass(frozen=True)
class Take:
    """One recording of the demo: the frames `first` to `last` - 1 of a drive, with a sensor attacked or none.

    `attacked_frames` count from the recording's first.
    """

    file: Path
    street: Street
    first: int
    last: int
    attacked: int | None = None
    attacked_frames: range = range(0)

    def __str__(self) -> str:
        return self.file.name


_ALDER = Street("alder", 1, 11, "city", 42)
_BIRCH = Street("birch", 2, 22, "residential", 28)
_CEDAR = Street("cedar", 3, 33, "city", 28)
_HIT = range(4, 11)


def fleet(folder: Path) -> tuple[tuple[Take, ...], tuple[Take, ...]]:
    """What the vehicles recorded while nobody attacked them, and what they recorded afterwards."""
    clean = (
        Take(folder / "alder_day.mcap", _ALDER, 0, 14),
        Take(folder / "birch_day.bag", _BIRCH, 0, 14),
        Take(folder / "cedar_day.db3", _CEDAR, 0, 14),
    )
    suspected = (
        Take(folder / "alder_evening.mcap", _ALDER, 14, 28),
        Take(folder / "alder_night.mcap", _ALDER, 28, 42, attacked=3, attacked_frames=_HIT),
        Take(folder / "birch_night.mcap", _BIRCH, 14, 28, attacked=1, attacked_frames=_HIT),
        Take(folder / "cedar_night.bag", _CEDAR, 14, 28, attacked=LIDAR, attacked_frames=_HIT),
    )
    return clean, suspected


def record(take: Take, progress: Callable[[str, int], None]) -> Path:
    """Render a take and write it with the real writer of its format. Raises RecordingError."""
    street = take.street
    drive = make_drive(
        street.seed,
        street.frames,
        style=street.style,
        vehicle=street.number,
        start_ns=_START_NS + street.number * 10**12,
    )
    attackers = []
    if take.attacked is not None:
        first, last = (drive.start_ns + (take.first + take.attacked_frames[at]) * 10**8 for at in (0, -1))
        attackers.append(Attacker(AttackPlan(take.attacked, seed=street.seed, from_ns=first, to_ns=last), drive.rig))
    _WRITERS[take.file.suffix](
        take.file, drive.rig, _frames(drive, take, attackers, progress), _labels(attackers), vehicle=street.vehicle
    )
    return take.file


def _frames(
    drive: SyntheticDrive, take: Take, attackers: list[Attacker], progress: Callable[[str, int], None]
) -> Iterator[Frame]:
    for done, number in enumerate(range(take.first, take.last), start=1):
        frame = drive.frame(number)
        for attacker in attackers:
            frame = _attacked(frame, attacker)
        yield frame
        progress(str(take), done)


def _attacked(frame: Frame, attacker: Attacker) -> Frame:
    sensor = attacker.plan.sensor
    if sensor != LIDAR:
        return replace(frame, images={**frame.images, sensor: attacker.change_image(frame.images[sensor])})
    assert frame.cloud is not None
    return replace(frame, cloud=attacker.change_cloud(frame.cloud))


def _labels(attackers: list[Attacker]) -> Iterator[AttackLabel]:
    """Known only once the frames have gone by."""
    yield from (attacker.label for attacker in attackers if attacker.label is not None)

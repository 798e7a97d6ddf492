"""`auditor attack`: a compromised copy of a recording, with its ground truth inside."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.output import answer
from auditor.cli.values import PATH, SENSOR, FiniteRange, LocalPath
from auditor.errors import SettingError

if TYPE_CHECKING:
    from auditor.lab.attacks.schedule import Attacker, AttackPlan
    from auditor.model.verdict import AttackLabel
    from auditor.pipeline.many import LimitsOf

_SECOND_NS = 10**9
_KINDS = (
    *("facula", "spot", "blue", "green", "red", "infrared", "veil", "projected", "stripes", "shutter"),
    *("blur", "electromagnetic", "dimmed", "soiled", "shifted", "pattern"),
)
_LIDAR_KINDS = (
    *("wall", "far-wall", "ghost", "jitter", "shift", "removed", "seen-through", "saturated", "pulses"),
    *("hidden", "scattered", "turned", "rain"),
)
_EITHER = ("delayed", "frozen")


@click.command("attack", short_help="A compromised copy with its ground truth.")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
@click.option("--on", "sensors", type=SENSOR, multiple=True, required=True, help="Sensor to attack; may be repeated.")
@click.option(
    "--kind",
    type=click.Choice((*_KINDS, *_LIDAR_KINDS, *_EITHER)),
    help="What is done, in place of a facula on a camera and a wall in the LiDAR's cloud.",
)
@click.option(
    "--size",
    type=FiniteRange(min=0),
    help="How much: radius of a facula or spot (px of an image 1242 px wide), width of a wall (m), veil and stripes "
    "(grey levels), points of a ghost, jitter or shift of a sector (m), share of the rows that the shutter's stripes "
    "light, height of what is projected (px of such an image), blur (px), electromagnetic stripes (number), range of a "
    "far wall or of an object that is removed or seen through (m), hidden or noisy sector, turned LiDAR (degrees), "
    "scattered points, "
    "rain (mm/h), delay (frames), shift (rows), soil (blobs), share of light that dims.",
)
@click.option("--range", "range_m", type=FiniteRange(min=1), help="How far away a ghost is, in m; 8 unless told.")
@click.option(
    "--pattern",
    type=LocalPath(exists=True, dir_okay=False),
    help="Image of a laser pattern for --kind pattern.",
)
@click.option(
    "--strength",
    type=click.Choice(["mild", "strong", "opaque"]),
    default="opaque",
    show_default=True,
    help="How bright a facula is: 255, 510 or 2000 grey levels at its centre.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Decides size and place.")
@click.option("--moving", is_flag=True, help="Draw size and place again for every frame.")
@click.option("--from", "from_s", type=float, help="Seconds after the recording's start when the attack begins.")
@click.option("--to", "to_s", type=float, help="Seconds after the recording's start when it ends.")
@options.setting("rig")
@options.budget_options
def command(
    source: Path,
    target: Path,
    rig: Path | None,
    limits: "LimitsOf",
    **wanted: Any,  # noqa: ANN401 - handed on to _Wanted, which declares them
) -> None:
    """Write a compromised copy: a Gaussian facula on a camera, a bogus wall into the LiDAR's point cloud.

    \b
    auditor attack clean.mcap attacked.mcap --on S_2
    auditor attack clean.mcap attacked.mcap --on S_0 --on S_1 --strength mild --from 2 --to 5
    auditor attack clean.mcap attacked.mcap --on S_0 --kind hidden --size 30
    auditor attack clean.mcap attacked.mcap --on S_3 --kind blue --strength mild
    auditor attack clean.mcap attacked.mcap --on S_0 --kind removed --size 20
    auditor attack clean.mcap attacked.mcap --on S_0 --kind ghost --size 120 --range 12
    auditor attack clean.mcap faulty.mcap --on S_2 --kind delayed --size 1

    The ground truth travels inside the copy and comes into the store with it.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.workers import run_within  # noqa: PLC0415 - keeps --help quick
    from auditor.recordings.writers.atomic import no_remains  # noqa: PLC0415

    told = _Wanted(**wanted)
    _check_span(told.from_s, told.to_s)
    if told.range_m is not None and told.kind != "ghost":
        raise SettingError("only a ghost has a range of its own", where="--range", remedy="use --kind ghost")
    with no_remains(target):
        run_within(limits(source), _attack, source, target, rig, told)
    answer(target)


@dataclass(frozen=True)
class _Wanted:
    """The options that say what is done to which sensors, and when."""

    sensors: tuple[int, ...]
    kind: str | None
    size: float | None
    range_m: float | None
    pattern: Path | None
    strength: str
    seed: int
    moving: bool
    from_s: float | None
    to_s: float | None


def _attack(source: Path, target: Path, rig: Path | None, wanted: _Wanted) -> None:
    """Write the compromised copy."""
    from auditor.lab.attacks.schedule import Attacker  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.measure import rigs_of  # noqa: PLC0415
    from auditor.recordings import open_recording, rewrite, survey  # noqa: PLC0415

    with open_recording(source) as recording:
        surveyed = survey(recording)
        known = rigs_of(surveyed, rig)[0]
        start_ns = min(sample.time_ns for sensor in known.sensors for sample in surveyed.samples(known.topic(sensor)))
        attackers = [Attacker(plan, known) for plan in _plans(wanted, start_ns)]
        changes = {
            known.topic(attacker.plan.sensor): attacker.change_image if attacker.plan.sensor else attacker.change_cloud
            for attacker in attackers
        }
        depths = {camera.topic: camera.depth_bits for camera in known.cameras if camera.depth_bits is not None}
        rewrite(recording, target, changes, _labels(attackers, start_ns), depths)


def _plans(wanted: _Wanted, start_ns: int) -> "Iterator[AttackPlan]":
    """One plan a sensor."""
    from auditor.lab.attacks.schedule import AttackPlan  # noqa: PLC0415
    from auditor.lab.evaluation.experiments import read_patterns  # noqa: PLC0415 - keeps --help quick

    pattern = read_patterns([wanted.pattern])[0] if wanted.pattern else None
    begin_ns, end_ns = _at(start_ns, wanted.from_s), _at(start_ns, wanted.to_s)
    for sensor in dict.fromkeys(wanted.sensors):
        yield AttackPlan(
            sensor,
            wanted.strength,
            wanted.seed,
            wanted.moving,
            begin_ns,
            end_ns,
            wanted.kind,
            wanted.size,
            pattern,
            wanted.range_m,
        )


def _at(start_ns: int, seconds: float | None) -> int | None:
    return None if seconds is None else start_ns + round(seconds * _SECOND_NS)


def _check_span(from_s: float | None, to_s: float | None) -> None:
    first, last = from_s or 0.0, to_s
    if math.isfinite(first) and (last is None or (math.isfinite(last) and first < last)):
        return
    raise SettingError(
        f"an attack cannot go from {first:g} s to {'the end' if last is None else f'{last:g} s'}",
        where="--from, --to",
        remedy="give seconds after the recording's start, --from before --to",
    )


def _labels(attackers: "list[Attacker]", start_ns: int) -> "Iterator[AttackLabel]":
    """The ground truth, read after the recording. Raises SettingError for a sensor that was not attacked."""
    for attacker in attackers:
        if attacker.label is None:
            raise _not_attacked(attacker, start_ns)
        yield attacker.label


def _not_attacked(attacker: "Attacker", start_ns: int) -> SettingError:
    sensor = f"S_{attacker.plan.sensor}"
    if attacker.newest_ns is None:
        return SettingError(f"no data of {sensor} could be decoded, so nothing was attacked", where="--on")
    long_s = (attacker.newest_ns - start_ns) / _SECOND_NS
    return SettingError(
        f"nothing was done to {sensor}, whose data ends {long_s:.1f} s after the recording's start",
        where="--from, --to",
        remedy="choose a time within that, and a delay that is shorter; nothing was written",
    )

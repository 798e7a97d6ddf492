"""`auditor attack`: a compromised copy of a recording, with its ground truth inside."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from auditor.cli import options
from auditor.cli.options import PATH, SENSOR, FiniteRange, LocalPath
from auditor.cli.output import answer
from auditor.errors import SettingError
from auditor.model.stamps import NANOSECONDS

if TYPE_CHECKING:
    from auditor.lab.attacks.kinds import AttackKind, Option
    from auditor.lab.attacks.schedule import Attacker, AttackPlan
    from auditor.model.verdict import AttackLabel
    from auditor.pipeline.workers import LimitsOf


class _Kinds(click.ParamType[str]):
    """The kinds of the catalogue, which is loaded when they are asked for: NumPy is heavy."""

    name = "kind"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The kind. Fails as click does, with the nearest one."""
        kinds = tuple(_catalogue())
        if value not in kinds:
            near = get_close_matches(value, kinds, 1)
            guess = f"did you mean {near[0]!r}? " if near else ""
            self.fail(f"there is no kind {value!r}; {guess}auditor attack --help lists all", param, ctx)
        return value

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's signature
        """The kinds that begin so."""
        return [
            CompletionItem(kind, help=one.does) for kind, one in _catalogue().items() if kind.startswith(incomplete)
        ]


class _Attack(click.Command):
    """A command with the options of each kind, whose help ends with what each does."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The options of kinds stand last."""
        own = [
            click.Option(
                [f"--{one.flag}", one.name], type=FiniteRange(min=one.least), help=f"With --kind {kind}: {one.says}."
            )
            for kind, one in _options()
        ]
        *params, shown = super().get_params(ctx)
        return [*params, *own, shown]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """A line a kind, made from the catalogue."""
        super().format_epilog(ctx, formatter)
        with formatter.section("Kinds, and what --size is of each"):
            formatter.write_dl([(kind, one.in_words) for kind, one in _catalogue().items()])


def _catalogue() -> "Mapping[str, AttackKind]":
    from auditor.lab.attacks.catalogue import KINDS  # noqa: PLC0415 - heavy

    return KINDS


def _options() -> "Iterator[tuple[str, Option]]":
    """The options of single kinds, with these."""
    return ((kind, one) for kind, known in _catalogue().items() for one in known.options)


@click.command("attack", cls=_Attack, short_help="A compromised copy with its ground truth.")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
@click.option("--on", "sensors", type=SENSOR, multiple=True, required=True, help="Sensor to attack; may be repeated.")
@click.option(
    "--kind",
    type=_Kinds(),
    metavar="KIND",
    help="What is done, in place of a facula on a camera and a wall in the LiDAR's cloud: a kind listed below.",
)
@click.option("--size", type=FiniteRange(min=0), help="How much, in the unit of the kind; see below.")
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
    from auditor.recordings.writers.mcap_file import no_remains  # noqa: PLC0415

    given = {one.name: wanted.pop(one.name) for _, one in _options()}
    told = _AttackOptions(**wanted, options={name: value for name, value in given.items() if value is not None})
    _check_span(told.from_s, told.to_s)
    for kind, option in _options():
        if option.name in told.options and told.kind != kind:
            only = f"only a {kind} has a {option.flag} of its own"
            raise SettingError(only, where=f"--{option.flag}", remedy=f"use --kind {kind}")
    with no_remains(target):
        run_within(limits(source), _attack, source, target, rig, told)
    answer(target)


@dataclass(frozen=True)
class _AttackOptions:
    """The options that say what is done to which sensors, and when."""

    sensors: tuple[int, ...]
    kind: str | None
    size: float | None
    pattern: Path | None
    strength: str
    seed: int
    moving: bool
    from_s: float | None
    to_s: float | None
    options: "Mapping[str, float]"


def _attack(source: Path, target: Path, rig: Path | None, wanted: _AttackOptions) -> None:
    """Write the compromised copy."""
    from auditor.lab.attacks.schedule import Attacker  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.geometry import rigs_of  # noqa: PLC0415
    from auditor.recordings import open_recording, rewrite, survey  # noqa: PLC0415

    with open_recording(source) as recording:
        surveyed = survey(recording)
        recording_rig = rigs_of(surveyed, rig)[0]
        start_ns = min(
            sample.time_ns
            for sensor in recording_rig.sensors
            for sample in surveyed.samples(recording_rig.topic(sensor))
        )
        attackers = [Attacker(plan, recording_rig) for plan in _plans(wanted, start_ns)]
        changes = {
            recording_rig.topic(attacker.plan.sensor): attacker.change_cloud
            if attacker.plan.sensor in recording_rig.lidars
            else attacker.change_image
            for attacker in attackers
        }
        depths = {camera.topic: camera.depth_bits for camera in recording_rig.cameras if camera.depth_bits is not None}
        rewrite(recording, target, changes, _labels(attackers, start_ns), depths)


def _plans(wanted: _AttackOptions, start_ns: int) -> "Iterator[AttackPlan]":
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
            wanted.options,
        )


def _at(start_ns: int, seconds: float | None) -> int | None:
    return None if seconds is None else start_ns + round(seconds * NANOSECONDS)


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
    long_s = (attacker.newest_ns - start_ns) / NANOSECONDS
    return SettingError(
        f"nothing was done to {sensor}, whose data ends {long_s:.1f} s after the recording's start",
        where="--from, --to",
        remedy="choose a time within that, and a delay that is shorter; nothing was written",
    )

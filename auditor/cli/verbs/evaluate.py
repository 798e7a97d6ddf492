"""`auditor evaluate`: the paper's experiments on one's own clean recordings."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged
from auditor.cli.options import PATH
from auditor.cli.output import emit, format_option, progress, say
from auditor.errors import SettingError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from auditor.lab.evaluation import EvaluationWork, Source, Task
    from auditor.measurement.disparity.matchers import MatcherOptions
    from auditor.model.settings import MeasureSettings
    from auditor.pipeline.workers import LimitsOf, Outcome, Progress
    from auditor.recordings import Location

SomeTask = TypeVar("SomeTask", bound="Task")

_STREET_FRAMES = 50
_FIRST_STREET = 1000


@click.command("evaluate", short_help="The paper's tables on your own clean logs.")
@click.argument("recordings", nargs=-1, metavar="[RECORDING]...", type=PATH)
@click.option("--synthetic", type=click.IntRange(min=1), metavar="N", help="Make N streets and evaluate on them too.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random attacks.")
@click.option(
    "--draws", type=click.IntRange(min=1), default=1, show_default=True, help="How often each frame is attacked again."
)
@click.option(
    "--attack-every",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Measure all frames clean, and attack only each N-th.",
)
@click.option(
    "--pattern",
    "patterns",
    multiple=True,
    type=PATH,
    help="An image of a laser pattern to lay over the camera images; may be given again.",
)
@click.option(
    "--detector",
    "detectors",
    multiple=True,
    help="Compare objects too, as the paper's baseline does: streets (networks that come with it), geometric, or "
    "onnx:FILE for images or for point clouds; may be given again.",
)
@click.option(
    "--labels",
    type=PATH,
    help="Folder of KITTI's object labels, to score the detectors of --detector by.",
)
@click.option(
    "--leave-out",
    type=click.Choice(["recording", "family"]),
    help="Print only figures whose thresholds come from other recordings, or from other families: a street's family is "
    "its style and condition, a recording is a family of its own.",
)
@options.store_option
@options.measuring_options(*options.MATCHER, "rig", *options.BUDGET, "jobs")
@format_option
def command(
    recordings: tuple[Path, ...],
    synthetic: int | None,
    seed: int,
    draws: int,
    attack_every: int,
    patterns: tuple[Path, ...],
    detectors: tuple[str, ...],
    labels: Path | None,
    leave_out: str | None,
    store: Path,
    measuring: "MeasureSettings",
    form: str,
) -> int:
    """Attack clean recordings in memory, measure every attack, and print how often it was detected and named.

    \b
    auditor evaluate clean_logs/*.mcap
    auditor evaluate clean_drive.mcap --draws 3 --store evaluation
    auditor evaluate --synthetic 40 --attack-every 10 --leave-out family
    auditor evaluate clean_logs/*.mcap --detector streets
    auditor evaluate clean_logs/*.mcap --matcher psmnet --weights network/psmnet.safetensors

    Faculas (mild, strong, opaque) and bogus walls, on one sensor, two and three, then stripes, hidden sectors, delays
    and displaced sensors; nothing is written but counts, and pictures of at most six attacks that were missed. What is
    finished is not measured again. auditor report evaluation writes the page, the evaluation queries answer the rest;
    evaluation_objects says how often objects that sensors see do not match. Evaluations with several matchers in one
    store are shown beside one another.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.many import network_of, share_threads  # noqa: PLC0415 - heavy
    from auditor.recordings import find_recordings  # noqa: PLC0415

    if not recordings and synthetic is None:
        raise SettingError("nothing to evaluate", where="evaluate", remedy="name clean recordings, or give --synthetic")
    network = network_of(measuring)
    _check(patterns, measuring.matcher, network, detectors, labels)
    inputs = find_recordings(recordings)
    for error in inputs.errors:
        say(f"auditor: {error}")
    sources = _sources(inputs.recordings, measuring.rig, synthetic or 0)
    if not sources:
        return Exit.FAILED
    network, jobs = share_threads(network, measuring.jobs)
    tasks = _tasks(sources, store, measuring.matcher, network, seed, draws, attack_every, jobs)
    complete = _evaluated(tasks, store, measuring, jobs, patterns, detectors, labels, leave_out, form)
    return Exit.CLEAN if complete and not inputs.errors else Exit.FAILED


def _check(
    patterns: tuple[Path, ...], matcher: str, network: "MatcherOptions", detectors: tuple[str, ...], labels: Path | None
) -> None:
    """Raises SettingError for what would else be an error of each recording."""
    from auditor.lab.evaluation import experiments_of  # noqa: PLC0415 - heavy
    from auditor.lab.evaluation.object_baseline import check_detectors  # noqa: PLC0415
    from auditor.measurement.disparity.matchers import find_matcher  # noqa: PLC0415

    experiments_of(patterns)
    find_matcher(matcher, network)
    check_detectors(detectors, labels)


def _evaluated(
    tasks: "Sequence[Task]",
    store: Path,
    measuring: "MeasureSettings",
    jobs: int,
    patterns: tuple[Path, ...],
    detectors: tuple[str, ...],
    labels: Path | None,
    leave_out: str | None,
    form: str,
) -> bool:
    """Measure the attacks of all shares, judge them, and print the summary; True where all could be measured."""
    from auditor.lab.evaluation import judge_cases, keep_missed  # noqa: PLC0415 - heavy
    from auditor.pipeline.many import limits_by_size  # noqa: PLC0415
    from auditor.store.queries import run_query  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    kept, old = Store.open(store, create=True), 0
    run = _Run(jobs, limits_by_size(measuring.time_limit, measuring.memory_limit))
    with logged(store):
        run.attacks(tasks, patterns)
        if detectors:
            run.objects(tasks, detectors, labels)
        if kept.ids("evaluations"):
            old = judge_cases(kept)
            keep_missed(kept, run.source_of, patterns, jobs, run.limits)
    if old:
        say(
            f"{old} parts that an earlier version evaluated are not judged, since it kept too little of each case: "
            "evaluate their recordings again"
        )
    if kept.ids("evaluations"):
        emit(run_query(kept, "evaluation_summary", {"left_out": leave_out or "all"}), form)
    return run.complete


def _sources(recordings: "Sequence[Location]", rig: Path | None, streets: int) -> "list[Source]":
    """The recordings, and so many synthetic streets."""
    from auditor.lab.evaluation import RecordingSource, Street  # noqa: PLC0415 - heavy

    synthetic = [Street(_FIRST_STREET + number, _STREET_FRAMES) for number in range(streets)]
    return [*(RecordingSource(path, rig) for path in recordings), *synthetic]


def _tasks(
    sources: "Sequence[Source]",
    store: Path,
    matcher: str,
    network: "MatcherOptions",
    seed: int,
    draws: int,
    attack_every: int,
    jobs: int,
) -> "list[Task]":
    """The shares of all sources: few recordings are shared among all processes."""
    from auditor.lab.evaluation import Task  # noqa: PLC0415 - heavy

    shares = -(-jobs // len(sources))
    how = partial(Task, matcher=matcher, network=network, seed=seed, draws=draws, attack_every=attack_every, of=shares)
    return [how(source, store, share=share) for source in sources for share in range(shares)]


class _Run:
    """An evaluation that runs: the source of each recording that was read, and whether all could be measured."""

    def __init__(self, jobs: int, limits: "LimitsOf") -> None:
        self._jobs, self.limits = jobs, limits
        self.source_of: dict[str, Source] = {}
        self.complete = True

    def attacks(self, tasks: "Sequence[Task]", patterns: tuple[Path, ...]) -> None:
        """Measure the attacks on some shares."""
        from auditor.lab.evaluation import EvaluateTask, evaluate_source  # noqa: PLC0415 - heavy

        self._measure(evaluate_source, [EvaluateTask(**vars(task), patterns=patterns) for task in tasks])

    def objects(self, tasks: "Sequence[Task]", detectors: tuple[str, ...], labels: Path | None) -> None:
        """Compare objects in some shares."""
        from auditor.lab.evaluation.object_baseline import ObjectTask, evaluate_objects  # noqa: PLC0415 - heavy

        self._measure(
            evaluate_objects, [ObjectTask(**vars(task), detectors=detectors, labels=labels) for task in tasks]
        )

    def _measure(self, evaluate: "Callable[[SomeTask, Progress], EvaluationWork]", tasks: "Sequence[SomeTask]") -> None:
        from auditor.pipeline.workers import run_all  # noqa: PLC0415 - keeps --help quick

        with progress(len(tasks), "evaluating") as (advanced, finished):
            for outcome in run_all(evaluate, tasks, self._jobs, advanced, lambda task: self.limits(task.source.path)):
                if outcome.result is not None:
                    self.source_of |= dict.fromkeys(outcome.result.recordings, outcome.item.source)
                self.complete &= outcome.error is None
                finished(_said(outcome))


def _said(outcome: "Outcome[SomeTask, EvaluationWork]") -> str:
    """What became of a share."""
    if outcome.error is not None:
        return f"auditor: {outcome.error.located(outcome.item)}"
    if outcome.result is not None and outcome.result.fresh:
        return f"{outcome.item}: {outcome.result.frames} frames, {outcome.result.cases} cases measured"
    return f"{outcome.item}: measured before"

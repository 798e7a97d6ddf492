"""`auditor evaluate`: the paper's experiments on one's own clean recordings."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged
from auditor.cli.output import emit, format_option, progress, say
from auditor.cli.values import PATH
from auditor.errors import SettingError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from auditor.lab.evaluation import Evaluated, Source, Task
    from auditor.measurement.disparity.matchers import MatcherOptions
    from auditor.pipeline.many import LimitsOf
    from auditor.pipeline.workers import Progress

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
    help="Compare objects too, as the paper's baseline does: geometric, or onnx:FILE for images or for point clouds; "
    "may be given again.",
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
@options.matcher_options
@options.rig_option
@options.budget_options
@options.jobs_option
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
    matcher: str,
    network: "MatcherOptions",
    rig: Path | None,
    limits: "LimitsOf",
    jobs: int,
    form: str,
) -> int:
    """Attack clean recordings in memory, measure every attack, and print how often it was detected and named.

    \b
    auditor evaluate clean_logs/*.mcap
    auditor evaluate clean_drive.mcap --draws 3 --store evaluation
    auditor evaluate --synthetic 40 --attack-every 10 --leave-out family
    auditor evaluate clean_logs/*.mcap --detector geometric
    auditor evaluate clean_logs/*.mcap --matcher psmnet --weights network/psmnet.safetensors

    Faculas (mild, strong, opaque) and bogus walls, on one sensor, two and three, then stripes, hidden sectors, delays
    and displaced sensors; nothing is written but counts, and pictures of at most six attacks that were missed. What is
    finished is not measured again. auditor report evaluation writes the page, the evaluation queries answer the rest;
    evaluation_objects says how often objects that sensors see do not match. Evaluations with several matchers in one
    store are shown beside one another.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.lab.evaluation import (  # noqa: PLC0415 - heavy
        EvaluateTask,
        Recorded,
        Street,
        Task,
        evaluate_source,
        experiments_of,
        judge_cases,
        keep_missed,
    )
    from auditor.lab.evaluation.object_baseline import ObjectTask, check_detectors, evaluate_objects  # noqa: PLC0415
    from auditor.measurement.disparity.matchers import find_matcher  # noqa: PLC0415
    from auditor.pipeline.many import share_threads  # noqa: PLC0415
    from auditor.recordings import find_recordings  # noqa: PLC0415
    from auditor.store import Store, run_query  # noqa: PLC0415

    if not recordings and synthetic is None:
        raise SettingError("nothing to evaluate", where="evaluate", remedy="name clean recordings, or give --synthetic")
    experiments_of(patterns)  # patterns that cannot be read, too, are the command's error
    find_matcher(matcher, network)  # an unknown one is the command's error, not each recording's
    check_detectors(detectors, labels)
    found = find_recordings(recordings)
    for error in found.errors:
        say(f"auditor: {error}")
    sources: list[Source] = [Recorded(path, rig) for path in found.recordings]
    sources += [Street(_FIRST_STREET + number, _STREET_FRAMES) for number in range(synthetic or 0)]
    if not sources:
        return Exit.FAILED
    kept = Store.open(store, create=True)
    network, jobs = share_threads(network, jobs)
    shares = -(-jobs // len(sources))  # few recordings are shared among all processes
    how = partial(Task, matcher=matcher, network=network, seed=seed, draws=draws, attack_every=attack_every, of=shares)
    tasks = [how(source, store, share=share) for source in sources for share in range(shares)]
    with logged(store):
        measured = [EvaluateTask(**vars(task), patterns=patterns) for task in tasks]
        of_recordings: dict[str, Source] = {}
        done = _evaluate_all(evaluate_source, measured, jobs, limits, of_recordings)
        if detectors:
            found_by = [ObjectTask(**vars(task), detectors=detectors, labels=labels) for task in tasks]
            done &= _evaluate_all(evaluate_objects, found_by, jobs, limits, of_recordings)
        old = 0
        if kept.ids("evaluations"):
            old = judge_cases(kept)
            keep_missed(kept, of_recordings, patterns, jobs, limits)
    if old:
        say(
            f"{old} parts that an earlier version evaluated are not judged, since it kept too little of each case: "
            "evaluate their recordings again"
        )
    if kept.ids("evaluations"):
        emit(run_query(kept, "evaluation_summary", {"left_out": leave_out or "all"}), form)
    return Exit.CLEAN if done and not found.errors else Exit.FAILED


def _evaluate_all(
    evaluate: "Callable[[SomeTask, Progress], Evaluated]",
    tasks: "Sequence[SomeTask]",
    jobs: int,
    limits: "LimitsOf",
    read: "dict[str, Source]",
) -> bool:
    """Measure all, and put into `read` the source of each recording; False where something could not be."""
    from auditor.pipeline.workers import run_all  # noqa: PLC0415

    done = True
    with progress(len(tasks), "evaluating") as (advanced, finished):
        for outcome in run_all(evaluate, tasks, jobs, advanced, lambda task: limits(task.source.path)):
            if outcome.result is not None:
                read |= dict.fromkeys(outcome.result.recordings, outcome.item.source)
            if outcome.error is not None:
                finished(f"auditor: {outcome.error.located(outcome.item)}")
                done = False
            elif outcome.result is not None and outcome.result.fresh:
                finished(f"{outcome.item}: {outcome.result.frames} frames, {outcome.result.cases} cases measured")
            else:
                finished(f"{outcome.item}: measured before")
    return done

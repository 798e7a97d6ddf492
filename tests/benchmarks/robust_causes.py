"""Whether faults are told from attacks: `python -m tests.benchmarks.robust_causes [--synthetic 2] [--faults-only]`.

All frames of drive 0009 of the folder AUDITOR_TEST_DATA (LiDAR, cam1, cam3, reference cam2) under each fault, which
lasts, and under each attack, drawn anew for every frame; thresholds at r = 1 % from the clean frames of drive 0001.
With --synthetic SCENES also streets of each style by thresholds of the other two, eight frames a scene. Of faults:
how often the verdict's likeliest cause is the fault in that sensor, how often the frame is `suspect` for it, and
how often a sensor was identified without doubt; of attacks how often the verdict is only `suspect`.
Streets are measured by --processes at a time and kept in --folder: a run that was stopped goes on where it was, and
what only judges may be changed and the kept streets judged again at once.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.faults import ObservedFeatures, fault_hypotheses, fault_scores
from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.scores import thresholds_from
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import use_one_thread
from auditor.model.calibration import RobustThresholds
from auditor.model.checks import COLUMNS, rig_pair_checks
from auditor.model.rig import Rig
from auditor.model.verdict import FINDINGS, Cause, CauseIn, FaultHypothesis, Verdict, VerdictKind
from auditor.pipeline.judge import system_of
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.real_drives import frames
from tests.benchmarks.robust_faults import CLEAN, FAULTS, PARTS
from tests.benchmarks.robust_watching import Series, Street, Watched, all_series, measure_streets, measured

FRAMES_A_SCENE = 8
LIKELIEST = 3


def told(part: Watched, rig: Rig) -> dict[CauseIn, np.ndarray]:
    """(F,) strength of each cause."""
    cameras = tuple(camera.number for camera in rig.cameras)
    columns = {name: part.fault_features[:, :, n] for n, name in enumerate(COLUMNS)}
    return fault_scores(
        ObservedFeatures(part.pairs, columns, cameras, part.level, part.saturated), part.stamps_ns, rig.sensors
    )


def learn(recordings: Sequence[Watched], rig: Rig) -> RobustThresholds:
    """Thresholds at r = 1 %."""
    r = Decimal("0.01")
    strong = [told(part, rig) for part in recordings]
    samples = {key: np.concatenate([one[key] for one in strong]) for key in strong[0]}
    known = {key: np.sort(values[~np.isnan(values)]).tolist() for key, values in samples.items()}
    clean = np.concatenate([part.ratios for part in recordings])
    return thresholds_from(clean, known, rig_pair_checks(rig), r)


def suspected(part: Watched, learnt: RobustThresholds, rig: Rig) -> list[tuple[FaultHypothesis, ...]]:
    """The causes of each frame worth telling, whether or not they explain its verdict."""
    return fault_hypotheses(told(part, rig), learnt.causes)


def judged(part: Watched, learnt: RobustThresholds, rig: Rig) -> list[Verdict]:
    """The verdicts of the robust method."""
    present = np.ones(part.fingerprints.shape, dtype=np.bool_)
    series = FrameSeries.of_recording(part.stamps_ns, part.ratios, present, part.fingerprints, told(part, rig))
    return judge_frames(series, system_of(rig), learnt)


def outcome(series: Series, verdict: Verdict) -> Counter[str]:
    """What one verdict counts for."""
    first = verdict.causes[0] if verdict.causes and verdict.causes[0].score >= 0.5 else None
    named = first is not None and (first.cause, first.sensor) == (series.cause, series.sensor)
    raised = verdict.kind in FINDINGS
    return Counter(
        all=1,
        raised=raised,
        named=named,
        raised_named=raised and named,
        suspect_named=verdict.kind is VerdictKind.SUSPECT and named,
        identified=verdict.kind is VerdictKind.ATTACKED,
        right=verdict.kind is VerdictKind.ATTACKED and verdict.attacked == (series.sensor,),
        suspect=verdict.kind is VerdictKind.SUSPECT,
        clean=verdict.kind is VerdictKind.CLEAN,
    )


def report(title: str, parts: Sequence[tuple[Rig, RobustThresholds, Sequence[Series]]], *, list_accused: bool) -> None:
    """Print every row, all sensors apart, then all faults and attacks; then each frame identified but not attacked."""
    rows: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    identified: list[str] = []
    for rig, learnt, happened in parts:
        for series in happened:
            kind = kind_of(series)
            verdicts = judged(series.frames, learnt, rig)
            for verdict in verdicts:
                counted = outcome(series, verdict)
                for name in names(series):
                    rows[kind, name].update(counted)
            if list_accused and kind != "attack":
                identified += accusations(series, verdicts, suspected(series.frames, learnt, rig))
    print(title)
    for (kind, name), n in rows.items():
        text = f"  {kind:6} {name:36} raised {n['raised']:4}/{n['all']:<4}"
        if kind == "fault":
            text += f" named {share(n['named'], n['all'])}, suspect for it {share(n['suspect_named'], n['all'])};"
            text += f" of those raised named {n['raised_named']};"
        elif kind == "attack":
            text += f" named {share(n['right'], n['all'])};"
        print(f"{text} identified {share(n['identified'], n['all'])}; suspect {share(n['suspect'], n['all'])}")
    if list_accused:
        print(*identified, sep="\n")


def kind_of(series: Series) -> str:
    """Which rows a series counts in."""
    return "fault" if series.cause else "clean" if series.sensor is None else "attack"


def names(series: Series) -> list[str]:
    """The names of its rows, each once."""
    who = "" if series.sensor is None else f" S_{series.sensor}"
    dry = ["all but rain"] if kind_of(series) == "fault" and series.cause is not Cause.RAIN else []
    return list(dict.fromkeys([f"{series.name}{who}", series.name, "all", *dry]))


def accusations(
    series: Series, verdicts: Sequence[Verdict], suspected: Sequence[tuple[FaultHypothesis, ...]]
) -> Iterator[str]:
    """A line for each identified frame: who was identified, by what, and the likeliest causes.

    Causes in brackets cannot have raised the evidence.
    """
    where = "" if series.sensor is None else f" S_{series.sensor}"
    for number, verdict, causes in zip(series.frames.numbers, verdicts, suspected, strict=True):
        if verdict.kind is not VerdictKind.ATTACKED:
            continue
        who = ", ".join(f"S_{sensor}" for sensor in verdict.attacked)
        why = ", ".join(f"{e.check_name} {e.i}-{e.k} {e.margin:.2f}" for e in verdict.evidence)
        ranked = sorted({*verdict.causes, *causes}, key=lambda one: -one.score)[:LIKELIEST]
        likeliest = ", ".join(_told(one, explains=one in verdict.causes) for one in ranked) or "no cause"
        yield f"  {series.name}{where}, {series.recording}, frame {number}: {who} by {why}; {likeliest}"


def _told(one: FaultHypothesis, *, explains: bool) -> str:
    text = f"{one.cause.value}{'' if one.sensor is None else f' S_{one.sensor}'} {one.score:.2f}"
    return text if explains else f"({text})"


def share(k: int, n: int) -> str:
    """k of n with the 95 % interval in per cent."""
    low, high = wilson_percent(k, n)
    return f"{k:4}/{n:<4} [{low:.0f}, {high:.0f}]"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--synthetic", type=int, default=0, metavar="SCENES", help="scenes of each style")
    parser.add_argument("--first", type=int, default=0, help="number of each style's first scene")
    parser.add_argument("--frames", type=int, default=FRAMES_A_SCENE, help="of each scene, two at least")
    parser.add_argument("--streets-only", action="store_true")
    parser.add_argument("--faults-only", action="store_true", help="no attacks")
    parser.add_argument("--list-identified", action="store_true", help="print each frame identified but not attacked")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("causes-scenes"), help="where measured scenes are kept")
    options = parser.parse_args()
    if options.frames < 2:
        parser.error("--frames: two frames a scene at least, or no sensor can be late")
    use_one_thread()
    happening = [FAULTS] if options.faults_only else list(PARTS)
    if not options.streets_only:
        report("drive 0009, thresholds of 0001", drives(happening), list_accused=options.list_accused)
    if options.synthetic:
        scenes = range(options.first, options.first + options.synthetic)
        asked = [
            Street(style, 1000 * place + scene, options.frames, part)
            for place, style in enumerate(STYLES, start=1)
            for scene in scenes
            for part in happening
        ]
        parts = streets(*measure_streets(asked, options.folder, options.processes))
        report("synthetic streets, thresholds of the other styles", parts, list_accused=options.list_accused)


def drives(happening: Sequence[str]) -> list[tuple[Rig, RobustThresholds, list[Series]]]:
    """Drive 0009 by what 0001 teaches."""
    rig, stream = frames("0001")
    learnt = learn([measured(stream, rig)], rig)
    rig, stream = frames("0009")
    kept = list(stream)
    return [(rig, learnt, [series for part in happening for series in all_series("0009", kept, rig, part)])]


def streets(rig: Rig, measured: Mapping[Street, Sequence[Series]]) -> list[tuple[Rig, RobustThresholds, list[Series]]]:
    """Each style by what the others teach."""
    of_style: dict[str, list[Series]] = defaultdict(list)
    for street, series in measured.items():
        of_style[street.style] += series
    clean = {style: [s.frames for s in happened if s.name == CLEAN] for style, happened in of_style.items()}
    others = {style: [part for other in clean if other != style for part in clean[other]] for style in clean}
    return [(rig, learn(others[style], rig), happened) for style, happened in of_style.items()]


if __name__ == "__main__":
    main()

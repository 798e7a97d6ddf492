"""The robust method beside the paper's: `python -m tests.benchmarks.robust_rates [--cameras 4] [--synthetic SCENES]`.

Drives 0009 (40 frames) and 0001 (10) of the folder AUDITOR_TEST_DATA; with --synthetic SCENES also so many streets of
each style judged by those of the others (at n = 4 by an evenly spaced rig), --only-synthetic without the drives.
Thresholds at r = 1 % are calibrated on the clean frames of one part and tested on another: 0009 on 0001, 0001 on 0009,
blocks of ten frames of 0009 on the rest of it.
Detection: any verdict but `clean` and `not_auditable`; identification: exactly the attacked set. Every rate carries
its counts and 95 % Wilson interval; frames of one scene resemble each other, so that the intervals are too narrow.
Scenes are measured by --processes at a time and kept in --folder: a run that was stopped goes on where it was.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from auditor.measurement import use_one_thread
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS, Verdict, VerdictKind
from tests.benchmarks.real_drives import frames
from tests.benchmarks.robust_judging import METHODS, clean_of, wilson
from tests.benchmarks.robust_measuring import Sample, samples
from tests.benchmarks.robust_series import Split, contaminated, incidents, lasting_attacks
from tests.benchmarks.robust_streets import LASTING_CAMERAS, measure_scenes, scenes_of

BLOCK = 10


def report(rig: Rig, splits: Sequence[Split]) -> None:
    """Print false alarms, detection and identification of every method, the splits pooled."""
    for name, method in METHODS.items():
        told: list[tuple[Sample, Verdict]] = []
        for clean, tested in splits:
            told.extend(zip(tested, method(rig, clean, tested), strict=True))
        quiet = [v for s, v in told if s.kind == "clean"]
        print(f"  {name}: false alarms {wilson(sum(v.kind is not VerdictKind.CLEAN for v in quiet), len(quiet))}")
        rows: dict[tuple[str, str], list[tuple[bool, bool, bool]]] = defaultdict(list)
        for s, v in told:
            if s.kind != "clean":
                exact = v.kind is VerdictKind.ATTACKED and v.attacked == s.attacked
                for row in _rows(rig, s):
                    rows[s.kind, row].append((v.kind in FINDINGS, exact, v.named == s.attacked))
        for (kind, who), outcome in rows.items():
            found, exact, named = (sum(column) for column in zip(*outcome, strict=True))
            text = f"    {kind:12} {who:13} detected {wilson(found, len(outcome))}"
            if not who.startswith("all"):
                text += f"   identified {wilson(exact, len(outcome))}   Algorithm 2 {named}"
            print(text)
        matrix = Counter((s.attacked, v.kind, v.attacked) for s, v in told if len(s.attacked) <= rig.max_attacked)
        wrong = {k: n for k, n in matrix.items() if k[0] != k[2] and k[1] is not VerdictKind.CLEAN}
        print("    truth -> other verdicts:", "; ".join(_arrow(k, n) for k, n in sorted(wrong.items())) or "none")


def _rows(rig: Rig, sample: Sample) -> list[str]:
    """The rows of the table that a sample counts in."""
    size = len(sample.attacked)
    combined = ["all together"] if rig.n == 3 and size >= 2 else []
    if size > rig.max_attacked:
        return combined
    each = (
        ["two"] if size == 2 else ["S_0"] if sample.attacked == (LIDAR,) else [f"S_{sample.attacked[0]}", "one camera"]
    )
    return each + combined


def _arrow(key: tuple[tuple[int, ...], VerdictKind, tuple[int, ...]], count: int) -> str:
    truth, kind, named = key
    return f"{set(truth) or 'clean'} -> {kind}{set(named) or ''} {count}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cameras", type=int, default=3, choices=[3, 4])
    parser.add_argument("--draws", type=int, default=2, help="of every attack on each frame of the drives")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--synthetic", type=int, default=0, metavar="SCENES", help="scenes of each style")
    parser.add_argument("--frames", type=int, default=50, help="of each scene")
    parser.add_argument("--period", type=int, default=10, help="the first five of so many frames are attacked")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("robust-scenes"), help="where measured scenes are kept")
    parser.add_argument("--only-synthetic", action="store_true")
    options = parser.parse_args()
    use_one_thread()
    if not options.only_synthetic:
        drives(options.cameras, options.draws, options.seed)
    if options.synthetic:
        scenes = scenes_of(options.synthetic, options.cameras, options.frames, options.seed, options.period)
        everything = [scene for of_style in scenes.values() for scene in of_style]
        rig, measured = measure_scenes(everything, options.folder, options.processes)
        streets(rig, {style: [s for one in of_style for s in measured[one]] for style, of_style in scenes.items()})


def drives(cameras: int, draws: int, seed: int) -> None:
    """The real drives, each judged by the other and 0009 by itself."""
    measured: dict[str, list[Sample]] = {}
    for number in ("0009", "0001"):
        rig, stream = frames(number, all_cameras=cameras == 4)
        measured[number] = list(samples(number, rig, stream, draws, seed + int(number)))
    hard, easy = measured["0009"], measured["0001"]
    print(f"calibrated on 0009, tested on 0001; n = {cameras}")
    report(rig, [(clean_of(hard), easy)])
    print(f"calibrated on 0001, tested on 0009; n = {cameras}")
    report(rig, [(clean_of(easy), hard)])
    print(f"blocks of ten of 0009, calibrated on the other three; n = {cameras}")
    blocks = sorted({sample.frame // BLOCK for sample in hard})
    parts = [([s for s in hard if s.frame // BLOCK != b], [s for s in hard if s.frame // BLOCK == b]) for b in blocks]
    report(rig, [(clean_of(others), part) for others, part in parts])


def streets(rig: Rig, measured: dict[str, list[Sample]]) -> None:
    """Synthetic streets: each style's scenes calibrated on the others', the vehicles' flaws different too."""
    count = len({s.recording for part in measured.values() for s in part})
    print(f"{count} synthetic streets, each style calibrated on the others; n = {rig.n}")
    others = {style: [s for other, part in measured.items() if other != style for s in part] for style in measured}
    splits = [(clean_of(others[style]), part) for style, part in measured.items()]
    report(rig, splits)
    incidents(rig, splits)
    if rig.n == LASTING_CAMERAS:
        lasting_attacks(rig, splits)
    last = next(reversed(measured))
    contaminated(rig, others[last], measured[last], np.random.default_rng(0))


if __name__ == "__main__":
    main()

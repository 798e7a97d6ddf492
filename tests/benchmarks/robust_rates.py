"""The robust method beside the paper's on real frames: `python -m tests.benchmarks.robust_rates [--cameras 4]`.

Drives 0009 (40 frames) and 0001 (10) of the folder AUDITOR_TEST_DATA; with --synthetic SCENES also streets of each
style judged by those of the others (at n = 4 by an evenly spaced rig). r = 1 %. Thresholds are calibrated on the clean
frames of one part and tested on another: 0009 on 0001, 0001 on 0009, blocks of ten frames of 0009 on the rest of it.
Detection: any verdict but `clean` and `not_auditable`; identification: exactly the attacked set. Every rate carries
its counts and 95 % Wilson interval.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from decimal import Decimal

import numpy as np

from auditor.elements import rig_elements
from auditor.evidence import use_one_thread
from auditor.identification.accusing import System, accuse
from auditor.identification.margins import margins, yardsticks
from auditor.identification.thresholds import threshold
from auditor.identification.verdicts import judge
from auditor.identification.windows import window_means
from auditor.lab.attacks import STRENGTHS
from auditor.lab.drives import make_drive
from auditor.lab.streets import STYLES
from auditor.results import FINDINGS, Verdict, VerdictKind
from auditor.rig import LIDAR, Rig
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.real_drives import frames
from tests.benchmarks.robust_measuring import Sample, samples

R = Decimal("0.01")
WINDOW_S = 0.5
BLOCK = 10
FRAMES_A_SCENE = 5
EVENLY_SPACED_M = (0.54, 0.36, 0.18, 0.0)

Judge = Callable[[Rig, Sequence[Sample], Sequence[Sample]], list[Verdict]]
Split = tuple[list[Sample], list[Sample]]


def paper(statistic: int) -> Judge:
    """E against theta, Algorithm 2, as `--method paper` judges."""

    def verdicts(rig: Rig, clean: Sequence[Sample], tested: Sequence[Sample]) -> list[Verdict]:
        columns = np.array([sample.E[statistic] for sample in clean]).T
        theta = [threshold(sorted(column[~np.isnan(column)].tolist()), R) for column in columns]
        return [
            judge(
                "".join(_state(E, t) for E, t in zip(s.E[statistic], theta, strict=True)),
                rig.triples,
                rig.sensors,
            )
            for s in tested
        ]

    return verdicts


def _state(E: float, theta: float) -> str:
    return "-" if np.isnan(E) else "01"[theta < E]


def robust(window_s: float | None) -> Judge:
    """Margins, joint identification; with a window their means over half a second."""

    def verdicts(rig: Rig, clean: Sequence[Sample], tested: Sequence[Sample]) -> list[Verdict]:
        elements = rig_elements(rig)
        scales = yardsticks(np.array([sample.ratios for sample in clean]), elements, R)
        z = margins(np.array([sample.ratios for sample in tested]), scales)
        if window_s is not None:
            z = _windowed(z, tested, window_s)
        return accuse(z, System(elements, rig.triples, rig.sensors), [frozenset()] * len(tested))

    return verdicts


def _windowed(z: np.ndarray, tested: Sequence[Sample], window_s: float) -> np.ndarray:
    """Each attack is a series of its own; its frames are attacked all, each by its own draw."""
    series: dict[object, list[int]] = defaultdict(list)
    for index, sample in enumerate(tested):
        series[sample.recording, sample.kind, sample.attacked, sample.draw].append(index)
    result = np.empty_like(z)
    for members in series.values():
        members.sort(key=lambda index: tested[index].stamp_ns)
        stamps = np.array([tested[index].stamp_ns for index in members], dtype=np.int64)
        result[members] = window_means(z[members], stamps, window_s)
    return result


METHODS = {
    "paper, plain E": paper(0),
    "paper, gated E": paper(1),
    "robust, single frames": robust(None),
    f"robust, windows of {WINDOW_S} s": robust(WINDOW_S),
}


def wilson(k: int, n: int) -> str:
    """k of n with the 95 % interval."""
    low, high = wilson_percent(k, n)
    return f"{k:5}/{n:<5} {100 * k / n:5.1f} [{low:5.1f}, {high:5.1f}]"


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


def clean_of(part: Sequence[Sample]) -> list[Sample]:
    """The clean frames of a part."""
    return [sample for sample in part if sample.kind == "clean"]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cameras", type=int, default=3, choices=[3, 4])
    parser.add_argument("--draws", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--synthetic", type=int, default=0, metavar="SCENES", help="scenes of each style")
    options = parser.parse_args()
    use_one_thread()
    measured: dict[str, list[Sample]] = {}
    for number in ("0009", "0001"):
        rig, stream = frames(number, all_cameras=options.cameras == 4)
        measured[number] = list(samples(number, rig, stream, options.draws, options.seed + int(number)))
    hard, easy = measured["0009"], measured["0001"]
    print(f"calibrated on 0009, tested on 0001; n = {options.cameras}")
    report(rig, [(clean_of(hard), easy)])
    print(f"calibrated on 0001, tested on 0009; n = {options.cameras}")
    report(rig, [(clean_of(easy), hard)])
    print(f"blocks of ten of 0009, calibrated on the other three; n = {options.cameras}")
    blocks = sorted({sample.frame // BLOCK for sample in hard})
    parts = [([s for s in hard if s.frame // BLOCK != b], [s for s in hard if s.frame // BLOCK == b]) for b in blocks]
    report(rig, [(clean_of(others), part) for others, part in parts])
    if options.synthetic:
        streets(options.synthetic, options.cameras, options.seed)


def streets(scenes: int, cameras: int, seed: int) -> None:
    """Synthetic streets: each style's scenes calibrated on the others', the vehicles' flaws different too."""
    measured: dict[str, list[Sample]] = {style: [] for style in STYLES}
    positions_m = EVENLY_SPACED_M if cameras == 4 else None
    for s, style in enumerate(measured):
        for scene in range(scenes):
            number = 1000 * (s + 1) + scene
            drive = make_drive(
                seed + number,
                FRAMES_A_SCENE,
                n_cameras=cameras,
                style=style,
                vehicle=number,
                positions_m=positions_m,
            )
            measured[style].extend(samples(f"{style} {scene}", drive.rig, drive.frames(), 1, number))
    print(f"synthetic streets, each style calibrated on the others; n = {cameras}")
    others = {style: [s for other, part in measured.items() if other != style for s in part] for style in measured}
    report(drive.rig, [(clean_of(others[style]), part) for style, part in measured.items()])
    last = next(reversed(measured))
    contaminated(drive.rig, others[last], measured[last], np.random.default_rng(seed))


def contaminated(rig: Rig, calibrated: list[Sample], tested: list[Sample], rng: np.random.Generator) -> None:
    """Faculas on single cameras again, where a share of the frames that were taken for clean had been attacked."""
    clean = clean_of(calibrated)
    camera = [s for s in tested if s.kind in STRENGTHS and len(s.attacked) == 1 and LIDAR not in s.attacked]
    for share in (0.0, 0.05, 0.1, 0.2):
        for strength in ("mild", "opaque"):
            bad = [s for s in calibrated if s.kind == strength and len(s.attacked) == 1]
            count = round(share * len(clean))
            order = rng.permutation(len(clean))
            mixed = [clean[c] for c in order[count:]] + [bad[b] for b in rng.permutation(len(bad))[:count]]
            told = list(zip(camera, robust(None)(rig, mixed, camera), strict=True))
            rates = {
                kind: wilson(sum(v.attacked == s.attacked for s, v in told if s.kind == kind), len(camera) // 3)
                for kind in ("mild", "opaque")
            }
            print(f"  {share:.0%} of the calibration {strength}: mild {rates['mild']}, opaque {rates['opaque']}")


if __name__ == "__main__":
    main()

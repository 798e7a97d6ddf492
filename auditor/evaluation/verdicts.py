"""What the robust method says of an evaluation's cases, by thresholds from all clean frames and held out."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.evaluation.experiments import scenario_1
from auditor.identification.robust import WINDOW_S, System, name_attacked
from auditor.identification.scores import scales_of, scores
from auditor.identification.statistics import window_means
from auditor.model.calibration import Scale
from auditor.model.checks import PairCheck, rig_pair_checks
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS, VerdictKind
from auditor.store import Store, rows_of, run_sql
from auditor.store.evaluation_tables import CHUNK_FRAMES, INTERVAL_FRAMES, JUDGED_R, CaseVerdict, write_case_verdicts

_CASES = """
SELECT
    setup, rig_id, recording_id, evaluation_id, experiment, frame, stamp_ns, draw, attacked, attack, strength, size,
    ratios
FROM cases
WHERE ratios IS NOT NULL
ORDER BY setup, evaluation_id, frame, draw
"""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """One case as the store has it; `ratios` is (M,), NaN where not measured."""

    evaluation_id: str
    recording_id: str
    rig_id: str
    experiment: str
    frame: int
    stamp_ns: int
    draw: int
    attacked: tuple[int, ...]
    attack: str | None
    strength: str | None
    size: float | None
    ratios: tuple[float, ...]

    @property
    def block(self) -> tuple[str, int]:
        """Its recording and the block of time in it."""
        return self.recording_id, self.frame // CHUNK_FRAMES

    @property
    def drive(self) -> tuple[str, str]:
        """The frames that follow each other: its recording, by its rig."""
        return self.recording_id, self.rig_id


def judge_cases(store: Store) -> None:
    """Judge every case of a store by the robust method and keep the verdicts. Raises StoreError.

    Thresholds come from the clean cases of the same rig kind and way of measuring, so that any new recording changes
    what is said of all: everything is judged anew.
    """
    rig_of = cache(store.rig)
    pair_checks_of = cache(lambda rig_id: rig_pair_checks(rig_of(rig_id)))
    setups: dict[tuple[str, tuple[PairCheck, ...]], list[Case]] = defaultdict(list)
    rigs: dict[tuple[str, tuple[PairCheck, ...]], Rig] = {}
    for row in rows_of(run_sql(store, _CASES)):
        setup = row["setup"], pair_checks_of(row["rig_id"])
        rigs[setup] = rig_of(row["rig_id"])
        setups[setup].append(_case(row))
    for setup, cases in setups.items():
        verdicts: dict[str, list[CaseVerdict]] = defaultdict(list)
        for evaluation_id, verdict in judged(cases, rigs[setup]):
            verdicts[evaluation_id].append(verdict)
        for evaluation_id, of_it in verdicts.items():
            write_case_verdicts(store, evaluation_id, of_it)


def judged(cases: Sequence[Case], rig: Rig) -> Iterator[tuple[str, CaseVerdict]]:
    """The verdicts on the cases of one rig kind, each with its part's id, by every system and way of holding out.

    A rig without triples has no systems, so that nothing is said of its cases.
    """
    pair_checks, of_rig = rig_pair_checks(rig), systems(rig)
    ratios = np.array([case.ratios for case in cases], dtype=np.float64).reshape(len(cases), len(pair_checks))
    clean = np.array([case.experiment == "clean" for case in cases], dtype=np.bool_)
    for held_out, tested, calibrated in _folds(cases, clean):
        if not calibrated.any():
            continue
        scales = scales_of(ratios[calibrated], pair_checks, JUDGED_R)
        z = scores(ratios, scales)
        window_z = _window(z, cases, np.flatnonzero(tested).tolist())
        for sensors in of_rig:
            chosen = [place for place in np.flatnonzero(tested).tolist() if _is_judged(cases[place], sensors, rig)]
            columns = [c for c, pair_check in enumerate(pair_checks) if set(pair_check.needed) <= set(sensors)]
            system = System(
                tuple(pair_checks[c] for c in columns), tuple(t for t in rig.triples if set(t) <= set(sensors)), sensors
            )
            samples = _fewest([scales[c] for c in columns])
            missing = _missing(ratios[np.ix_(chosen, columns)], system)
            found = name_attacked(z[np.ix_(chosen, columns)], system, missing)
            window = name_attacked(window_z[np.ix_(chosen, columns)], system, missing)
            for place, verdict, of_window in zip(chosen, found, window, strict=True):
                case = cases[place]
                finding = sensors == of_rig[-1] and verdict.kind in FINDINGS and of_window.kind in FINDINGS
                yield (
                    case.evaluation_id,
                    CaseVerdict(
                        frame=case.frame,
                        stamp_ns=case.stamp_ns,
                        draw=case.draw,
                        attacked=case.attacked,
                        attack=case.attack,
                        strength=case.strength,
                        size=case.size,
                        system=sensors,
                        held_out=held_out,
                        samples=samples,
                        verdict=verdict.kind,
                        accused=verdict.attacked if verdict.kind is VerdictKind.ATTACKED else (),
                        lasting=of_window.kind if finding else None,
                        lasting_accused=of_window.attacked if finding else (),
                    ),
                )


def _window(z: Floats, cases: Sequence[Case], tested: Sequence[int]) -> Floats:
    """Margins of the half seconds around clean frames, and around those of each attacked interval of a clean drive.

    NaN for all other cases: their neighbours were not attacked alike.
    """
    found = np.full_like(z, np.nan)
    drives: dict[tuple[str, str], list[int]] = defaultdict(list)
    for place, case in enumerate(cases):
        if case.experiment == "clean":
            drives[case.drive].append(place)
    series: dict[tuple[object, ...], list[int]] = defaultdict(list)
    for place in tested:
        case = cases[place]
        if case.experiment == "clean":
            series[case.drive].append(place)
        elif case.experiment == "intervals":
            interval = case.evaluation_id, case.frame // INTERVAL_FRAMES
            series[*interval, case.draw, case.attacked, case.strength].append(place)
    for places in series.values():
        drive = sorted(drives[cases[places[0]].drive], key=lambda place: cases[place].frame)
        row_of = {cases[place].frame: row for row, place in enumerate(drive)}
        rows, attacked = z[drive], [row_of[cases[place].frame] for place in places]
        rows[attacked] = z[places]
        stamps = np.array([cases[place].stamp_ns for place in drive], dtype=np.int64)
        found[places] = window_means(rows, stamps, WINDOW_S)[attacked]
    return found


def systems(rig: Rig) -> tuple[tuple[int, ...], ...]:
    """Each triple of the leftmost camera; all sensors; of more than three cameras with a LiDAR also those of n = 3."""
    everyone = {sensor for triple in rig.triples for sensor in triple}
    found = [tuple(triple) for triple in rig.triples if triple.k == rig.n]
    if len(everyone) > 4 and LIDAR in everyone:
        found.append((LIDAR, 1, 2, rig.n))
    if len(everyone) > 3:
        found.append(tuple(sorted(everyone)))
    return tuple(found)


def _case(row: Mapping[str, Any]) -> Case:
    fields = {name: value for name, value in row.items() if name not in ("setup", "attacked", "ratios")}
    ratios = tuple(np.nan if ratio is None else ratio for ratio in row["ratios"])
    return Case(attacked=tuple(row["attacked"]), ratios=ratios, **fields)


def _folds(
    cases: Sequence[Case], clean: NDArray[np.bool_]
) -> Iterator[tuple[str, NDArray[np.bool_], NDArray[np.bool_]]]:
    """Ways of holding out: its name, the cases to be judged, and the clean cases to calibrate on."""
    yield "nothing", np.ones_like(clean), clean
    for held_out, parts in (("block", [c.block for c in cases]), ("recording", [c.recording_id for c in cases])):
        for part in dict.fromkeys(parts):
            inside = np.array([other == part for other in parts], dtype=np.bool_)
            yield held_out, inside, clean & ~inside


def _is_judged(case: Case, sensors: tuple[int, ...], rig: Rig) -> bool:
    """Whether a case says something of a system: its sensors are attacked, and no more than can be told apart."""
    if not set(case.attacked) <= set(sensors):
        return False
    if case.experiment == "sensitivity":
        return sensors == scenario_1(rig)
    if case.experiment == "intervals":
        return sensors == systems(rig)[-1]
    if len(sensors) == 3:
        return case.experiment in ("clean", "combinations")
    return case.experiment != "combinations" or len(case.attacked) <= len(sensors) - 3


def _missing(ratios: Floats, system: System) -> list[frozenset[int]]:
    """The sensors of which nothing was measured in each case."""
    touching = {s: [s in pair_check.needed for pair_check in system.pair_checks] for s in system.sensors}
    measured = np.stack([~np.isnan(ratios[:, touching[s]]).all(axis=1) for s in system.sensors], axis=1)
    return [
        frozenset(s for s, there in zip(system.sensors, row, strict=True) if not there) for row in measured.tolist()
    ]


def _fewest(scales: Sequence[Scale | None]) -> int:
    return min((scale.samples for scale in scales if scale is not None), default=0)

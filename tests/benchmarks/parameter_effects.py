"""The effect of every number that measures or judges, 20 % lower and 20 % higher (docs/parameters.md).

Judging parameters: the scenes that `python -m tests.benchmarks.clean_statistics` measured are judged again. Measuring
parameters: four frames of three real drives, clean and attacked, are measured anew and judged by the prior alone.
What was found is kept in a file of JSON lines, and a run that was stopped goes on where it was. With --only the numbers
of these names alone are tried (all of a group by its name):

    python -m tests.benchmarks.parameter_effects judging --scenes FOLDER --streets FOLDER --kept judging.jsonl
    python -m tests.benchmarks.parameter_effects measuring --drives DATA --kept measuring.jsonl
    python -m tests.benchmarks.parameter_effects page --kept judging.jsonl measuring.jsonl --page docs/parameters.md
"""

import argparse
import json
import os
import pickle
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from decimal import Decimal
from hashlib import sha256
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import wrap
from types import ModuleType

import auditor
from auditor.model.parameter import Number, list_parameters

FACTORS = (0.8, 1.2)
R = Decimal("0.01")
RIGS = ((1, 2, 3, 4), (1, 2, 3), (1, 3))
"""The cameras that kept scenes are judged by: priors differ by how many take part."""

FRAMES = {"0009": 2, "0001": 1, "04": 1}
"""By drive how many of its frames the measuring parameters are tried on."""

COUNTED_WHEN_MEASURED = {"windowed_mean", "disparity_error_samples", "pair_depth", "stored_residuals"}
"""Judging parameters that kept scenes have behind them: they are tried on frames that are measured anew."""

OF_FAULTS_AND_REGIONS = {"row_alignment", "lidar_agreement", "coverage", "damaged_pixels", "damaged_points"}
OF_OTHER_RIGS = {"rig_geometry", "common_view", "lens_reach", "rectification", "psmnet_input"}
LEFT_OUT = OF_FAULTS_AND_REGIONS | OF_OTHER_RIGS | {"half_resolution", "region_mask"}
"""Measuring parameters that no check of these drives needs, or (half_resolution) that are built into the program."""

OF_CURVES = {"likelihood", "thrown_light", "uncoloured_light"}
"""Judging parameters that are points of curves: fitted together, none of them means anything by itself."""

OF_MATCHER = {"sgbm", "equalising"}
FAILED = "failed"
ATTACKS = {"R 75 mild": "R 75", "paper's facula": "facula", "wall 1 m": "wall"}
"""Attacks that are counted, and what their columns are called."""

JUDGED_COLUMNS = (
    *("not clean", "R 75", "facula", "wall", "wrongly named"),
    *("prior: not clean", "prior: R 75", "prior: wall"),
)
MARK = "<!-- from here on written by tests/benchmarks/parameter_effects.py -->"

Columns = dict[str, float]
Place = tuple[str, str, int | None]
"""Group, name, and place in a tuple."""
_FORK = get_context("fork")


@dataclass(frozen=True)
class Variant:
    """One number of a group, times `factor`; `place` is its place in a tuple."""

    group: str
    name: str
    place: int | None
    factor: float


def varied(value: Number, factor: float) -> Number:
    """The number times the factor; a whole one is rounded, and changes by one at least."""
    if not isinstance(value, int):
        return type(value)(float(value) * factor)
    step = 1 if factor > 1 else -1
    return max(round(value * factor), value + step) if factor > 1 else min(round(value * factor), value + step)


def change(group: object, name: str, place: int | None, factor: float) -> None:
    """Change one number of a frozen group in place: to be done before modules that read it are imported."""
    value = getattr(group, name)
    if place is None:
        changed = varied(value, factor)
    else:
        changed = tuple(varied(one, factor) if at == place else one for at, one in enumerate(value))
    object.__setattr__(group, name, changed)


def variants(groups: Iterable[object]) -> Iterator[Variant]:
    """All variants of the numbers of some groups, but of those that are 0."""
    for one in list_parameters(*groups):
        places = range(len(one.value)) if isinstance(one.value, tuple) else [None]
        for place in places:
            if one.value if place is None else one.value[place]:
                yield from (Variant(one.group, one.name, place, factor) for factor in FACTORS)


def parameters_of(room: str) -> ModuleType:
    """A room's module of parameters, without the room, whose modules read them when they are imported."""
    package, name = f"auditor.{room}", f"auditor.{room}.parameters"
    if name not in sys.modules:
        bare = ModuleType(package)  # a stand-in, from which the module can import the room's other parameters
        bare.__path__ = [str(Path(auditor.__file__).parent / room)]
        sys.modules[package] = bare
        import_module(name)
        del sys.modules[package]
    return sys.modules[name]


def groups_by_name(*rooms: str) -> dict[str, object]:
    """All groups of some rooms, by the names that their parameters have."""
    listed = {"measurement": "MEASURING", "identification": "JUDGING"}
    groups = [group for room in rooms for group in getattr(parameters_of(room), listed[room])]
    return {list_parameters(group)[0].group: group for group in groups}


def in_child(work: Callable[[], object]) -> object:
    """What `work` gives in a forked process; the text of its error where it fails."""
    receiver, sender = _FORK.Pipe(duplex=False)

    def run() -> None:
        try:
            sender.send(work())
        except Exception as error:  # noqa: BLE001 - a number that cannot be varied is a finding
            sender.send({FAILED: f"{type(error).__name__}: {error}".splitlines()[0]})

    child = _FORK.Process(target=run)
    child.start()
    sender.close()
    found = receiver.recv()
    child.join()
    return found


def judged(drives: Path, streets: Path) -> Columns:
    """How many frames of kept scenes are judged so: drives by each other, and drives and streets by the prior alone.

    With two cameras nothing can be named, and an attacked frame counts where it is found.
    """
    from auditor.model.verdict import VerdictKind  # noqa: PLC0415 - its module reads parameters
    from tests.benchmarks.rates import judge_all  # noqa: PLC0415
    from tests.benchmarks.scenes import load  # noqa: PLC0415

    found: Columns = dict.fromkeys(JUDGED_COLUMNS, 0)
    scenes = load(drives)
    every = [*scenes, *load(streets)]
    for cameras in RIGS:
        by_prior = judge_all(every, cameras, R, prior=True)
        for prefix, cases in (("", judge_all(scenes, cameras, R)), ("prior: ", by_prior)):
            for one in cases:
                attack, verdict = one.case.attack, one.robust
                reported = verdict.kind is not VerdictKind.CLEAN
                named = verdict.attacked == one.case.attacked if attack and len(cameras) > 2 else reported
                wrong = bool(set(verdict.attacked) - set(one.case.attacked))
                for column, so in ((ATTACKS.get(attack, attack) or "not clean", named), ("wrongly named", wrong)):
                    if prefix + column in found:
                        found[prefix + column] += so
    return found


def sample(drives: Path) -> list[tuple]:
    """(rig, frame, attacked sensors): each frame clean, and with a mild facula on one camera and a wall.

    Cameras take turns. The facula has a radius of 75 px, the wall a width of 1 m.
    """
    import numpy as np  # noqa: PLC0415

    from auditor.lab.attacks.paper import Facula, draw_wall  # noqa: PLC0415
    from auditor.lab.evaluation.sources import Recorded  # noqa: PLC0415
    from auditor.model.frames import Frame  # noqa: PLC0415
    from auditor.model.rig import LIDAR  # noqa: PLC0415
    from tests.benchmarks.clean_statistics import DRIVES  # noqa: PLC0415

    rng, found = np.random.default_rng(0), []
    for drive, number in FRAMES.items():
        with Recorded(drives / DRIVES[drive]).open(colour=True) as opened:
            rig = opened[0].rig
            frames = [one for one in opened[0].frames if isinstance(one, Frame)]
        for at in np.linspace(0, len(frames) - 1, number + 2).astype(int)[1:-1]:
            frame, camera = frames[at], rig.cameras[len(found) // 2 % len(rig.cameras)]
            place = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)
            lit = Facula(255.0, 75.0, *place).apply(frame.images[camera.number])
            wall = replace(draw_wall(rng), width_m=1.0).apply(frame.cloud, rig)
            attacked = replace(frame, images={**frame.images, camera.number: lit}, cloud=wall)
            found += [(rig, frame, ()), (rig, attacked, (LIDAR, camera.number))]
    return found


class RememberedMatcher:
    """A matcher whose maps are kept, by the images."""

    def __init__(self, matcher: object, maps: dict) -> None:
        self.matcher, self.maps = matcher, maps

    def __getattr__(self, name: str) -> object:
        return getattr(self.matcher, name)

    def reaching(self, disparity_1m_px):
        return RememberedMatcher(self.matcher.reaching(disparity_1m_px), self.maps)

    def match(self, left, right):
        key = self.matcher.range_px, sha256(left.tobytes() + right.tobytes()).digest()
        if key not in self.maps:
            self.maps[key] = self.matcher.match(left, right)
        return self.maps[key].copy()


def measured(frames: Path, maps: dict) -> Columns:
    """Mean z of the checks of lit cameras, and of the LiDAR's under a wall; the largest z of clean frames."""
    import numpy as np  # noqa: PLC0415

    from auditor.identification.scores import normalised_scores, thresholds_from  # noqa: PLC0415
    from auditor.measurement import measure, use_one_thread  # noqa: PLC0415
    from auditor.model.rig import LIDAR  # noqa: PLC0415
    from tests.benchmarks.clean_statistics import MATCHER, case_of  # noqa: PLC0415
    from tests.benchmarks.rates import system_of  # noqa: PLC0415
    from tests.benchmarks.scenes import Scene  # noqa: PLC0415

    use_one_thread()
    matcher = RememberedMatcher(MATCHER, maps)
    z_of: dict[str, list[float]] = defaultdict(list)
    for rig, frame, attacked in pickle.loads(frames.read_bytes()):
        system = system_of(Scene("", "", rig, "", ()), RIGS[0])
        thresholds = thresholds_from([], system.sensor_checks, system.judged_together, R)
        case = case_of(measure(frame, rig, matcher)[0], rig)
        expected = [thresholds.expected[check] for check in system.sensor_checks]
        z = normalised_scores(case.statistics[None], expected)[0]
        for sensor in attacked:
            of_sensor = [value for check, value in zip(system.sensor_checks, z, strict=True) if check.sensor == sensor]
            z_of["wall" if sensor == LIDAR else "lit"].append(float(np.nanmean(of_sensor)))
        if not attacked:
            z_of["clean"].append(float(np.nanmax(z[system.counting(frozenset())])))
    return {
        "z lit": float(np.mean(z_of["lit"])),
        "z wall": float(np.mean(z_of["wall"])),
        "z clean": float(np.mean(z_of["clean"])),
        "z clean, largest": float(np.max(z_of["clean"])),
    }


def import_libraries() -> None:
    """Import all that the children need of other projects, so that each need not."""

    def names() -> list[str]:
        import_module("tests.benchmarks.rates")
        return [name for name in sys.modules if name.split(".")[0] not in {"auditor", "tests"}]

    for name in in_child(names):
        with suppress(ImportError):
            import_module(name)


def keep_all(
    kept: Path, work: Callable[[Variant | None], Columns], groups: Mapping[str, object], only: Sequence[str]
) -> None:
    """Add what is missing to the kept file: the values that ship first, then every variant, or those `only`."""
    before = read(kept) if kept.exists() else []
    if before and before[0]["commit"] != commit():
        raise SystemExit(f"{kept}: it is of commit {before[0]['commit']}: go on there, or keep this one elsewhere")
    known = {json.dumps(line["variant"]) for line in before}
    wanted = (v for v in variants(groups.values()) if not only or {v.group, f"{v.group}.{v.name}"} & set(only))
    for variant in (None, *wanted):
        as_kept = None if variant is None else asdict(variant)
        if json.dumps(as_kept) in known:
            continue

        def of_variant(one: Variant | None = variant) -> Columns:
            if one is not None:
                change(groups[one.group], one.name, one.place, one.factor)
            return work(one)

        value = None if variant is None else getattr(groups[variant.group], variant.name)
        line = {"variant": as_kept, "value": value, "found": in_child(of_variant)}
        if variant is None:
            assert FAILED not in line["found"], line
            line |= {"commit": commit(), "date": f"{datetime.now(UTC):%Y-%m-%d}"}
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        print(line, flush=True)


def keep_judged(drives: Path, streets: Path, kept: Path, only: Sequence[str]) -> None:
    """Try the judging parameters on kept scenes."""
    groups = groups_by_name("identification")
    tried = {name: group for name, group in groups.items() if name not in COUNTED_WHEN_MEASURED | OF_CURVES}
    keep_all(kept, lambda _: judged(drives, streets), tried, only)


def keep_measured(drives: Path, kept: Path, only: Sequence[str]) -> None:
    """Try the measuring parameters, and those that turn counts into statistics."""
    groups = {name: one for name, one in groups_by_name("measurement").items() if name not in LEFT_OUT}
    judging = groups_by_name("identification")
    groups |= {name: judging[name] for name in sorted(COUNTED_WHEN_MEASURED)}
    with TemporaryDirectory() as folder:
        frames = Path(folder) / "frames"
        in_child(lambda: frames.write_bytes(pickle.dumps(sample(drives))))

        def maps_that_ship() -> dict:
            maps: dict = {}
            measured(frames, maps)
            return maps

        maps = in_child(maps_that_ship)
        keep_all(kept, lambda one: measured(frames, {} if one and one.group in OF_MATCHER else maps), groups, only)


def commit() -> str:
    """The commit that is tried."""
    done = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def read(kept: Path) -> list[dict]:
    """The lines of a kept file."""
    return [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]


def table(kept: Path) -> Iterator[str]:
    """Where and when a file was made, the effects as a table, the largest first, and the numbers without any."""
    ships, *others = read(kept)
    found: dict[Place, dict[float, Columns]] = defaultdict(dict)
    values: dict[Place, float] = {}
    refused: list[str] = []
    for line in others:
        group, name, place, factor = line["variant"].values()
        if FAILED in line["found"]:
            refused.append(f"{shown((group, name, place))} times {factor}")
        else:
            found[group, name, place][factor] = line["found"]
        values[group, name, place] = line["value"] if place is None else line["value"][place]
    columns: Columns = ships["found"]
    effects = {key: effect(tried.values(), columns) for key, tried in found.items()}
    yield from (f"Measured {ships['date']}, commit {ships['commit']}.", "")
    yield f"| Parameter | Ships | {' | '.join(columns)} |"
    yield "|:---|---:|" + "---:|" * len(columns)
    yield f"| as it ships | | {' | '.join(f'{value:.4g}' for value in columns.values())} |"
    for key in sorted((key for key in effects if effects[key]), key=lambda one: -effects[one]):
        cells = [difference(found[key], columns, name) for name in columns]
        yield f"| {shown(key)} | {values[key]:.4g} | {' | '.join(cells)} |"
    same = {key for key, tried in found.items() if all(one == columns for one in tried.values())}
    lists = {
        "Below 0.005 in every column": [shown(key) for key in effects if not effects[key] and key not in same],
        "Without any effect here": [shown(key) for key in same],
        "Refused by the program": refused,
    }
    for text, names in lists.items():
        if names:
            yield from ("", *wrap(f"{text}: {', '.join(sorted(names))}.", 115, break_on_hyphens=False))


def effect(tried: Iterable[Columns], ships: Columns) -> float:
    """The largest difference in any column, to two digits after the point."""
    return max(round(abs(one[name] - was), 2) for one in tried for name, was in ships.items())


def difference(tried: Mapping[float, Columns], ships: Columns, name: str) -> str:
    """By how much a column differs for each factor; 0 where it does for none, ? where a factor was not tried."""
    by = [round(tried[factor][name] - ships[name], 2) if factor in tried else None for factor in FACTORS]
    return "/".join("?" if one is None else f"{one:+.4g}" if one else "0" for one in by) if any(by) else "0"


def shown(key: Place) -> str:
    """A number's name in the page: the elements of priors by name, of other tuples by place."""
    group, name, place = key
    parts = ("mean", "within", "between", "tail") if group.endswith("priors") else "1234567"
    return f"{group}.{name}" + ("" if place is None else f" {parts[place]}")


def write_page(kept: Sequence[Path], page: Path) -> None:
    """Write the tables below the mark of a page; what stands above it stays."""
    head = page.read_text(encoding="utf-8").split(MARK)[0]
    lines = [
        line
        for one in kept
        for line in ("", f"## {one.stem.replace('_', ' ').capitalize()} parameters", "", *table(one))
    ]
    page.write_text(head + "\n".join([MARK, *lines]) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=("judging", "measuring", "page"))
    parser.add_argument("--scenes", type=Path, help="the folder of measured scenes of drives, clean and attacked")
    parser.add_argument("--streets", type=Path, help="the folder of measured scenes of streets")
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--kept", type=Path, nargs="+", required=True)
    parser.add_argument("--only", nargs="+", default=(), help="groups, or names as the page has them")
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    if options.what != "page":
        import_libraries()
    if options.what == "judging":
        keep_judged(options.scenes, options.streets, options.kept[0], options.only)
    elif options.what == "measuring":
        keep_measured(options.drives, options.kept[0], options.only)
    else:
        write_page(options.kept, options.page)


if __name__ == "__main__":
    main()

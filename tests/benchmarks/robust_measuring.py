"""What the robust benchmarks measure: clean frames and attacked ones, each sensor's part computed once."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from auditor.elements import Element, Witness, rig_elements
from auditor.evidence.cells import cells_of_likeness, cells_of_points
from auditor.evidence.comparing import compare_cameras, compare_with_lidar
from auditor.evidence.contradiction import adjudicate
from auditor.evidence.lidar import lidar_view
from auditor.evidence.likeness import likeness
from auditor.evidence.matchers import find_matcher
from auditor.evidence.photometric import coarse, compare_light
from auditor.evidence.reduction import halve
from auditor.evidence.sectors import emptiness
from auditor.evidence.stereo import stereo_map
from auditor.evidence.texture import textured
from auditor.frames import CameraImage, Frame, PointCloud
from auditor.identification.local_ratio import WINDOWS, local_ratio
from auditor.lab.attacks import STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.results import Statistic
from auditor.rig import LIDAR, Rig, Triple

WALLS_M = (0.5, 1.0, 1.5, 2.5)
SMALL = ((75.0, "mild"), (75.0, "opaque"), (112.5, "mild"))
MATCHER = find_matcher("sgbm")

Attack = Facula | BogusWall


@dataclass(frozen=True)
class Sample:
    """One frame, clean or attacked: its kind, who was attacked, the (M,) local ratios and the (2, T) E."""

    recording: str
    frame: int
    stamp_ns: int
    kind: str
    attacked: tuple[int, ...]
    draw: int
    ratios: tuple[float, ...]
    E: tuple[tuple[float, ...], ...]


class Bench:
    """Measures one frame under many attacks."""

    def __init__(self, rig: Rig, frame: Frame) -> None:
        self.rig, self.frame = rig, frame
        self.elements = rig_elements(rig)
        self._known: dict[Hashable, Any] = {}

    def measure(self, attacks: Mapping[int, Attack]) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
        """Local ratios by element and (plain, gated) E by triple, with these attacks on these sensors."""
        ratios = tuple(self._ratio(element, attacks) for element in self.elements)
        counts = [self._counts(triple, attacks) for triple in self.rig.triples]
        E = tuple(tuple(np.nan if (x := c.disparity_error(s)) is None else x for c in counts) for s in Statistic)
        return ratios, E

    def _once(self, what: str, sensors: tuple[int, ...], attacks: Mapping[int, Attack], make: Callable[[], Any]) -> Any:
        key = (what, sensors, tuple(attacks.get(sensor) for sensor in sensors))
        if key not in self._known:
            self._known[key] = make()
        return self._known[key]

    def _image(self, i: int, attacks: Mapping[int, Attack]) -> CameraImage:
        attack = attacks.get(i)
        image = self.frame.images[i]
        return self._once("image", (i,), attacks, lambda: attack.apply(image) if isinstance(attack, Facula) else image)

    def _cloud(self, attacks: Mapping[int, Attack]) -> PointCloud:
        wall, cloud = attacks.get(LIDAR), self.frame.cloud
        return self._once(
            "cloud", (LIDAR,), attacks, lambda: wall.apply(cloud, self.rig) if isinstance(wall, BogusWall) else cloud
        )

    def _half(self, i: int, attacks: Mapping[int, Attack]) -> Any:
        return self._once("half", (i,), attacks, lambda: halve(self._image(i, attacks).pixels))

    def _texture(self, i: int, attacks: Mapping[int, Attack]) -> Any:
        return self._once("texture", (i,), attacks, lambda: textured(self._half(i, attacks)))

    def _stereo(self, i: int, k: int, attacks: Mapping[int, Attack]) -> Any:
        def make() -> Any:
            left, right = self._image(k, attacks).pixels, self._image(i, attacks).pixels
            return stereo_map(MATCHER, left, right, self._texture(k, attacks), self._texture(i, attacks))

        return self._once("stereo", (i, k), attacks, make)

    def _likeness(self, i: int, k: int, attacks: Mapping[int, Attack]) -> Any:
        return self._once(
            "likeness",
            (i, k),
            attacks,
            lambda: likeness(self._half(k, attacks), self._half(i, attacks), self._stereo(i, k, attacks)),
        )

    def _view(self, k: int, attacks: Mapping[int, Attack]) -> Any:
        key = {LIDAR: attacks[LIDAR]} if LIDAR in attacks else {}
        return self._once(f"view {k}", (LIDAR,), key, lambda: lidar_view(self._cloud(attacks), self.rig, k))

    def _ratio(self, element: Element, attacks: Mapping[int, Attack]) -> float:
        witness, i, k = element
        sensors = (LIDAR, i, k) if witness is Witness.CONTRADICTED else (LIDAR,) if i == LIDAR else (i, k)

        def make() -> float:
            if witness is Witness.EMPTY:
                return emptiness(self._view(k, attacks), self.rig.camera(k).width_px)
            if witness is Witness.LIGHT:
                light = compare_light(coarse(self._half(i, attacks)), coarse(self._half(k, attacks)))
                return max(light.brighter_i, light.brighter_k)
            pair = self._likeness(i, k, attacks)
            if witness is Witness.UNLIKE:
                cells = cells_of_likeness(pair)
            else:
                halves = self._half(k, attacks), self._half(i, attacks)
                view, stereo = self._view(k, attacks), self._stereo(i, k, attacks)
                points = adjudicate(view, stereo, pair, self.rig, i, halves)
                cells = cells_of_points(points, self.rig.camera(k).height_px, self.rig.camera(k).width_px)
            found = local_ratio(cells.valid, cells.against, WINDOWS[witness])
            return found.ratio if found else np.nan

        return self._once(f"ratio {witness} {k}", sensors, attacks, make)

    def _counts(self, triple: Triple, attacks: Mapping[int, Attack]) -> Any:
        i, j, k = triple

        def make() -> Any:
            if i == LIDAR:
                return compare_with_lidar(self._view(k, attacks), self._stereo(j, k, attacks), self.rig, j).counts
            maps = self._stereo(i, k, attacks), self._stereo(j, k, attacks)
            return compare_cameras(*maps, self.rig.baseline_m(i, k), self.rig.baseline_m(j, k)).counts

        return self._once("counts", tuple(triple), attacks, make)


def cases(rig: Rig, rng: np.random.Generator) -> Iterator[tuple[str, dict[int, Attack]]]:
    """One draw of every attack: walls, faculas, small faculas, and every allowed or paper's combination of them."""
    wall = draw_wall(rng)
    for width in WALLS_M:
        yield f"wall {width} m", {LIDAR: _resized(wall, width)}
    camera = rig.cameras[0]
    faculas = {c.number: draw_facula(rng, c.width_px, c.height_px, "mild") for c in rig.cameras}
    for radius, strength in SMALL:
        scaled = radius * camera.width_px / 1242
        for c, f in faculas.items():
            yield f"R {radius:g} {strength}", {c: Facula(STRENGTHS[strength], scaled, f.u_px, f.v_px)}
    for strength, A in STRENGTHS.items():
        attacks: dict[int, Attack] = {c: Facula(A, f.radius_px, f.u_px, f.v_px) for c, f in faculas.items()}
        for c, f in attacks.items():
            yield strength, {c: f}
        attacks[LIDAR] = wall
        largest = rig.n + 1 if rig.n == 3 else rig.max_attacked
        for size in range(2, largest + 1):
            for chosen in combinations(rig.sensors, size):
                yield strength, {sensor: attacks[sensor] for sensor in chosen}


def _resized(wall: BogusWall, width_m: float) -> BogusWall:
    return BogusWall(wall.range_m, wall.lateral_m, wall.bottom_m, width_m, wall.height_m, wall.seed)


def samples(recording: str, rig: Rig, frames: Iterable[Frame], draws: int, seed: int) -> Iterator[Sample]:
    """Every frame clean, and under `draws` draws of every attack."""
    for frame in frames:
        bench = Bench(rig, frame)
        yield Sample(recording, frame.number, frame.stamp_ns, "clean", (), 0, *bench.measure({}))
        for draw in range(draws):
            drawn = np.random.default_rng([seed, frame.number, draw])
            for kind, attacks in cases(rig, drawn):
                measured = bench.measure(attacks)
                yield Sample(recording, frame.number, frame.stamp_ns, kind, tuple(sorted(attacks)), draw, *measured)

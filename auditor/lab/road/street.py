"""A straight street with all that stands along it. The vehicle drives along x = 0, on the right-hand side."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from auditor.lab.road.atlas import Picture, make_atlas
from auditor.lab.road.houses import block, cottage, facing_road, fence, lamp_post, road_sign
from auditor.lab.road.noise import Plane, rough
from auditor.lab.road.pictures import materials, tree_shadow
from auditor.lab.road.plants import bush, hedge, tree
from auditor.lab.road.shading import Light, Scenery
from auditor.lab.road.surfaces import Look, Surface, level, pack, upright
from auditor.lab.road.vehicles import SHAPES, vehicle, vehicle_pictures

Style = Literal["city", "residential"]

BEHIND_M = 12.0
AHEAD_M = 130.0
_MAP_HALF_M = 20.48
_MAP_TEXELS = (4096, 1024)
_KERBS = (-7.4, 4.2)
_PARKED = (-6.2, 3.1)
_ONCOMING_X = -3.3
_KERB_M = 0.12
_SHADOW_TEXELS = 192


@dataclass
class _Plot:
    """What is being built, and what lies on the ground: (rows, columns) maps whose first row is far."""

    rng: np.random.Generator
    near: float
    far: float
    to_sun: Plane
    surfaces: list[Surface]
    ground: Plane
    sunshine: Plane

    def texels(self, left: float, right: float, near: float, far: float) -> tuple[slice, slice]:
        """The part of the maps that covers a rectangle of ground."""
        rows, columns = self.ground.shape
        along = rows / (self.far - self.near)
        across = columns / (2 * _MAP_HALF_M)
        top, bottom = (int((self.far - z) * along) for z in (far, near))
        first, last = (int((x + _MAP_HALF_M) * across) for x in (left, right))
        return slice(max(top, 0), max(bottom, 0)), slice(max(first, 0), max(last, 0))

    def in_house_shade(self, x: float) -> bool:
        """True beside the houses that stand towards the sun, when it is low."""
        return bool(x * np.sign(self.to_sun[0]) > self.shade_from)

    shade_from: float = 99.0


def make_scenery(seed: int, length_m: float, style: Style) -> Scenery:
    """A street that a vehicle can follow from z = 0 over `length_m` metres."""
    rng = np.random.default_rng([seed, 0])
    to_sun = _draw_sun(rng)
    near, far = -BEHIND_M, length_m + AHEAD_M
    plot = _Plot(
        rng=rng,
        near=near,
        far=far,
        to_sun=to_sun,
        surfaces=[],
        ground=_road(rng, far - near),
        sunshine=np.ones(_MAP_TEXELS, np.float32),
        shade_from=float(rng.uniform(0.0, 6.0)) if style == "city" and rng.random() < 0.5 else 99.0,
    )
    _lay_ground(plot)
    for side in (-1, 1):
        if style == "city":
            _city_side(plot, side)
        else:
            _residential_side(plot, side)
        _park(plot, side, gap=0.45 if style == "city" else 0.6)
    _traffic(plot)
    _end_of_street(plot)
    pictures = {
        **materials(rng),
        **vehicle_pictures(),
        "ground": Picture(plot.ground),
        "sunshine": Picture(plot.sunshine),
    }
    atlas = make_atlas(pictures)
    light = Light(
        to_sun=to_sun,
        sun=float(rng.uniform(0.75, 1.0)),
        sky=float(rng.uniform(0.16, 0.3)),
        shadow="sunshine",
        shadow_corner=(-_MAP_HALF_M, far),
        shadow_size_m=(2 * _MAP_HALF_M, near - far),
        surroundings="surroundings",
        horizon_brightness=float(rng.uniform(0.9, 1.4)),
        zenith_brightness=float(rng.uniform(0.6, 1.0)),
    )
    return Scenery(pack(plot.surfaces, atlas), atlas, light)


def _draw_sun(rng: np.random.Generator) -> Plane:
    elevation, azimuth = rng.uniform(0.6, 1.0), rng.uniform(0.3, np.pi - 0.3) * rng.choice([-1, 1])
    return np.array(
        [np.cos(elevation) * np.sin(azimuth), -np.sin(elevation), np.cos(elevation) * np.cos(azimuth)], np.float32
    )


def _road(rng: np.random.Generator, length_m: float) -> Plane:
    """Albedo of the ground: asphalt with patches and lines, kerbs, and beyond them whatever there is."""
    rows, columns = _MAP_TEXELS
    x = (np.arange(columns) + 0.5) / columns * 2 * _MAP_HALF_M - _MAP_HALF_M
    z = np.arange(rows) / rows * length_m
    ground = 0.30 + 0.02 * np.tile(rough(rng, (1024, 1024), 1.1, 3), (rows // 1024, columns // 1024))
    for _ in range(int(length_m / 12)):
        top, first = rng.integers(0, rows - 300), rng.integers(300, columns - 400)
        ground[top : top + rng.integers(20, 300), first : first + rng.integers(15, 80)] *= rng.uniform(0.75, 1.15)
    centre = np.abs(x + 1.75) < 0.06
    ground[np.ix_((z % 9) < 4.5, centre)] = 0.75
    for kerb in _KERBS:
        ground[:, np.abs(x - kerb) < 0.25] *= 1.35
    off = (x < _KERBS[0]) | (x > _KERBS[1])
    ground[:, off] *= 0.9
    return np.asarray(np.clip(ground, 0.05, 1), dtype=np.float32)


def _lay_ground(plot: _Plot) -> None:
    asphalt = Look("ground", detail=0.13, detail_m=5.0)
    plot.surfaces.append(level(-_MAP_HALF_M, _MAP_HALF_M, plot.near, plot.far, 0.0, asphalt))
    plot.surfaces.append(
        level(-90, 90, plot.near, plot.far + 60, -0.06, Look("grass", (30, 50), albedo=0.3, detail=0.2))
    )
    for side, kerb in zip((-1, 1), _KERBS, strict=True):
        outer = kerb + side * 3.0
        left, right = sorted((kerb, outer))
        for near in np.arange(plot.near, plot.far, 20.0):
            kind = "paving" if plot.rng.random() < 0.6 else "weathered"
            albedo = float(plot.rng.uniform(0.3, 0.55))
            look = Look(kind, (3.0 / 2.4, 20 / 2.4), albedo=albedo, detail=0.1, detail_m=4.0)
            plot.surfaces.append(level(left, right, near, near + 20, _KERB_M, look))
        stone = Look("weathered", ((plot.far - plot.near) / 4, 0.05), albedo=0.5, detail=0.1)
        plot.surfaces.append(facing_road(kerb, plot.near, plot.far, 0.0, _KERB_M, stone, side))


def _city_side(plot: _Plot, side: int) -> None:
    rng = plot.rng
    kerb = _KERBS[side > 0]
    z = plot.near
    while z < plot.far:
        length = float(rng.uniform(8, 22))
        front = kerb + side * float(rng.uniform(3.0, 4.2))
        if rng.random() < 0.85:
            plot.surfaces += block(rng, side, front, z, z + length)
        else:
            plot.surfaces += fence(rng, side, kerb + side * 3.0, z, z + length)
            _plant_tree(plot, kerb + side * float(rng.uniform(5, 8)), z + length / 2)
        z += length + (float(rng.uniform(0.0, 5.0)) if rng.random() < 0.3 else 0.0)
    _street_furniture(plot, side, tree_gap_m=22.0)


def _residential_side(plot: _Plot, side: int) -> None:
    rng = plot.rng
    kerb = _KERBS[side > 0]
    z = plot.near
    while z < plot.far:
        length = float(rng.uniform(10, 16))
        front = kerb + side * float(rng.uniform(6.0, 9.0))
        plot.surfaces += cottage(rng, side, front, z, z + length)
        edge = kerb + side * 3.0
        if rng.random() < 0.45:
            left, right = sorted((edge, edge + side * 1.1))
            plot.surfaces += hedge(rng, left, right, z, z + length, float(rng.uniform(0.8, 1.9)))
        else:
            plot.surfaces += fence(rng, side, edge, z, z + length)
        for _ in range(3):
            x = edge + side * float(rng.uniform(1.2, 2.8))
            plot.surfaces += bush(rng, x, z + float(rng.uniform(0, length)), float(rng.uniform(0.8, 1.8)))
        z += length + float(rng.uniform(3, 8))
    _street_furniture(plot, side, tree_gap_m=13.0)


def _street_furniture(plot: _Plot, side: int, tree_gap_m: float) -> None:
    rng = plot.rng
    kerb = _KERBS[side > 0]
    z = plot.near + float(rng.uniform(0, 8))
    while z < plot.far:
        _plant_tree(plot, kerb + side * float(rng.uniform(0.5, 1.2)), z)
        z += tree_gap_m * float(rng.uniform(0.6, 1.5))
    for lamp in np.arange(plot.near + rng.uniform(0, 20), plot.far, 28.0):
        plot.surfaces += lamp_post(kerb + side * 0.5, float(lamp), side)
    for sign in np.arange(plot.near + rng.uniform(0, 20), plot.far, 60.0):
        plot.surfaces += road_sign(rng, kerb + side * 0.6, float(sign))


def _plant_tree(plot: _Plot, x: float, z: float) -> None:
    rng = plot.rng
    height, crown = float(rng.uniform(7, 12)), float(rng.uniform(2.2, 3.6))
    plot.surfaces += tree(rng, x, z, height, crown)
    reach = (height - crown) / -float(plot.to_sun[1])
    x, z = x - reach * float(plot.to_sun[0]), z - reach * float(plot.to_sun[2])
    _stamp(plot, x, z, crown * 1.2)


def _stamp(plot: _Plot, x: float, z: float, radius_m: float) -> None:
    """A crown's shadow on the map of sunshine."""
    part = plot.texels(x - radius_m, x + radius_m, z - radius_m, z + radius_m)
    here = plot.sunshine[part]
    if here.size == 0:
        return
    shadow = tree_shadow(plot.rng, _SHADOW_TEXELS)
    rows = np.arange(here.shape[0]) * _SHADOW_TEXELS // here.shape[0]
    columns = np.arange(here.shape[1]) * _SHADOW_TEXELS // here.shape[1]
    here *= shadow[np.ix_(rows, columns)]


def _park(plot: _Plot, side: int, gap: float) -> None:
    """A row of parked vehicles with gaps."""
    rng = plot.rng
    z = plot.near
    while z < plot.far - 10:
        z += float(rng.uniform(0.7, 1.6))
        if rng.random() < gap:
            z += float(rng.uniform(4, 14))
        name = str(rng.choice(["hatchback", "saloon", "estate", "van"], p=[0.36, 0.31, 0.28, 0.05]))
        length = SHAPES[name].length_m
        x = _PARKED[side > 0] + float(rng.uniform(-0.12, 0.12))
        sunlit = 0.0 if plot.in_house_shade(x) else 1.0
        plot.surfaces += vehicle(name, x, z + length / 2, towards_us=side < 0, paint=_paint(rng), sunlit=sunlit)
        z += length


def _paint(rng: np.random.Generator) -> float:
    """Two of three parked cars are dark."""
    return float(rng.uniform(0.02, 0.1)) if rng.random() < 0.6 else float(rng.uniform(0.2, 0.85))


def _traffic(plot: _Plot) -> None:
    rng = plot.rng
    speed = float(rng.uniform(7, 10))
    z = float(rng.uniform(25, 70))
    while z < 3 * plot.far:
        name = str(rng.choice(list(SHAPES)))
        plot.surfaces += vehicle(name, _ONCOMING_X, z, towards_us=True, paint=_paint(rng), speed_m_s=-speed)
        z += float(rng.uniform(25, 90))


def _end_of_street(plot: _Plot) -> None:
    far = Look("far", (4.0, 1.0), detail=0.1, both_sided=True)
    plot.surfaces.append(upright((-90.0, plot.far + 20), (90.0, plot.far + 20), -1.0, 16.0, far))

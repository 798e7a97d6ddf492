"""Houses, walls and fences along a street. `side` is -1 left of the road and +1 right of it."""

import numpy as np

from auditor.lab.road.surfaces import Look, Surface, prism, upright

_LETTERS_M = 0.6


def facing_road(x: float, near: float, far: float, bottom_m: float, top_m: float, look: Look, side: int) -> Surface:
    """A wall along the street, seen from the road."""
    ends = ((x, near), (x, far)) if side < 0 else ((x, far), (x, near))
    return upright(*ends, bottom_m, top_m, look)


def block(rng: np.random.Generator, side: int, x: float, near: float, far: float) -> list[Surface]:
    """A city house of several floors right at the pavement; its facade is windows, ribbed metal, brick or bare."""
    height = float(rng.uniform(6, 14))
    kind = rng.choice(["windows", "ribs", "boards", "bricks", "bare"], p=[0.5, 0.08, 0.06, 0.18, 0.18])
    look = _facade(rng, str(kind), far - near, height)
    base = 3.2 if rng.random() < 0.5 and kind != "bare" else 0.0
    surfaces = [facing_road(x, near, far, base, height, look, side)]
    room = Look("weathered", ((far - near) / 8, 1.0), albedo=0.3, both_sided=True)
    surfaces.append(facing_road(x + side * 1.5, near, far, 0.0, height, room, side))
    if base:
        shop = Look("shopfront", ((far - near) / 6.4, 1.0), detail=0.04, gloss=1.0)
        surfaces.append(facing_road(x, near, far, 0.0, base, shop, side))
        surfaces.append(_signboard(rng, side, x, near, far))
    end = Look("weathered", ((far - near) / 8, 1.0), albedo=look.albedo * 0.9, detail=0.05)
    left, right = sorted((x, x + side * 12))
    surfaces.append(upright((left, near), (right, near), 0.0, height, end))
    pipe = Look(albedo=0.3, detail=0.1)
    surfaces += prism(x - side * 0.08, near + 0.3, 0.06, 0.0, height, pipe, sides=4)
    return surfaces


def _facade(rng: np.random.Generator, kind: str, length_m: float, height_m: float) -> Look:
    albedo = float(rng.uniform(0.35, 0.85))
    if kind == "windows":
        return Look("windows", (round(length_m / 11) or 1, height_m / 12.5), albedo=albedo, detail=0.05, gloss=1.0)
    if kind == "ribs":
        return Look("ribs", (length_m / 2.4, 1.0), albedo=albedo * 0.8, detail=0.02)
    if kind == "boards":
        return Look("boards", (length_m / 2, height_m / 2.5), albedo=albedo * 0.8, detail=0.03)
    if kind == "bricks":
        return Look("bricks", (length_m / 4, height_m / 2.6), albedo=albedo * 0.6, detail=0.08)
    return Look("weathered", (length_m / 16, height_m / 16), albedo=albedo, detail=0.025)


def _signboard(rng: np.random.Generator, side: int, x: float, near: float, far: float) -> Surface:
    start = float(rng.uniform(near, far - 3.5))
    board = Look("sign", (1.0, 1.0), albedo=float(rng.uniform(0.5, 1.0)), detail=0.02)
    return facing_road(x - side * 0.1, start, start + 3.0, 3.3, 3.3 + 1.5 * _LETTERS_M, board, side)


def cottage(rng: np.random.Generator, side: int, x: float, near: float, far: float) -> list[Surface]:
    """A house with a tiled roof that falls towards the road, and a gable."""
    eaves = float(rng.uniform(2.8, 5.5))
    ridge = eaves + float(rng.uniform(2.5, 4.0))
    deep = 9.0
    wall = Look(
        "windows",
        (round((far - near) / 10) or 1, eaves / 11),
        albedo=float(rng.uniform(0.5, 0.95)),
        detail=0.03,
        gloss=1.0,
    )
    if rng.random() < 0.3:
        wall = Look("weathered", ((far - near) / 12, 1.0), albedo=wall.albedo, detail=0.012)
    roof = Look("tiles", ((far - near) / 4.8, 1.2), albedo=float(rng.uniform(0.25, 0.55)), detail=0.06)
    rise = ridge - eaves
    back = x + side * deep / 2
    front = x - side * 0.4
    start, along = ((near, far - near), (far, near - far))[side > 0]
    surfaces = [
        facing_road(x, near, far, 0.0, eaves, wall, side),
        Surface((back, -ridge, start), (0.0, 0.0, along), (front - back, rise, 0.0), roof),
    ]
    end = Look("weathered", (0.7, 0.4), albedo=wall.albedo, detail=0.02)
    surfaces.append(facing_road(x + side * 1.5, near, far, 0.0, eaves, end, side))
    left, right = sorted([x, x + side * deep])
    surfaces.append(upright((left, near), (right, near), 0.0, eaves, end))
    surfaces.append(upright((left, near), (right, near), eaves, ridge, Look("gable", albedo=wall.albedo, detail=0.02)))
    return surfaces


def fence(rng: np.random.Generator, side: int, x: float, near: float, far: float) -> list[Surface]:
    """Slats, bars or a bare garden wall."""
    kind = rng.choice(["slats", "mesh", "wall"], p=[0.4, 0.25, 0.35])
    height = float(rng.uniform(0.9, 1.8))
    if kind == "wall":
        look = Look(
            "weathered", ((far - near) / 8, 0.25), albedo=float(rng.uniform(0.4, 0.9)), detail=0.015, both_sided=True
        )
    else:
        look = Look(
            str(kind), ((far - near) / 2.4, 1.0), albedo=float(rng.uniform(0.25, 0.9)), detail=0.08, both_sided=True
        )
    return [facing_road(x, near, far, 0.0, height, look, side)]


def lamp_post(x: float, z: float, side: int) -> list[Surface]:
    """A post with an arm over the road."""
    metal = Look(albedo=0.35, detail=0.08)
    arm = facing_road(x, z, z + 0.12, 6.9, 7.0, metal, side)
    left, right = sorted((x, x - side * 1.4))
    reach = upright((left, z), (right, z), 6.9, 7.0, metal)
    return [*prism(x, z, 0.07, 0.0, 7.0, metal, sides=6), arm, reach]


def road_sign(rng: np.random.Generator, x: float, z: float) -> list[Surface]:
    """A sign on a thin post, seen from the front."""
    high = float(rng.uniform(2.0, 2.4))
    board = Look("sign", (0.5, 1.0), albedo=1.0, detail=0.0, both_sided=True)
    post = prism(x, z + 0.05, 0.035, 0.0, high + 0.3, Look(albedo=0.4, detail=0.05), sides=4)
    return [*post, upright((x - 0.35, z), (x + 0.35, z), high, high + 0.7, board)]

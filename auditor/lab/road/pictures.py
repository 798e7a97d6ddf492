"""The painted pictures: materials, facades and plants. Albedos are those of sunlit matter, 0..1."""

import numpy as np
from numpy.typing import NDArray

from auditor.lab.road.atlas import Picture
from auditor.lab.road.noise import Plane, rough, smoothed


def materials(rng: np.random.Generator) -> dict[str, Picture]:
    """Everything that drives wear, whatever the street; vehicles and the street's own maps come on top."""
    return {
        "plain": Picture(np.ones((4, 4), np.float32)),
        "grain": Picture(_grain(rng)),
        "surroundings": Picture(_surroundings(rng)),
        "ribs": Picture(_ribs()),
        "boards": Picture(_boards(rng)),
        "bricks": Picture(_bricks(rng, rows=32, columns=16, joint=0.75)),
        "paving": Picture(_bricks(rng, rows=16, columns=16, joint=0.6)),
        "tiles": Picture(_tiles(rng)),
        "weathered": Picture(np.clip(0.9 + 0.1 * rough(rng, (256, 256), 1.2), 0.4, 1)),
        "bark": Picture(np.clip(0.7 + 0.25 * rough(rng, (256, 64), 0.6), 0.2, 1)),
        "foliage": _leaves(rng, share_of_holes=0.42),
        "sparse": _leaves(rng, share_of_holes=0.68),
        "hedge": _leaves(rng, share_of_holes=0.0),
        "grass": Picture(np.clip(0.75 + 0.3 * rough(rng, (256, 256), 0.5), 0.1, 1)),
        "twigs": _twigs(rng),
        "slats": _slats(),
        "mesh": _mesh(),
        "windows": _windows(rng, wall=0.8),
        "shopfront": _shopfront(rng),
        "sign": Picture(_lettering(rng)),
        "far": _far(rng),
        "gable": _gable(),
    }


def _grain(rng: np.random.Generator) -> Plane:
    coarse, fine = rough(rng, (1024, 1024), 1.0, 4), rough(rng, (1024, 1024), 0.15, 64)
    return np.asarray(np.clip(0.6 * coarse + 0.8 * fine, -2.5, 2.5), dtype=np.float32)


def _surroundings(rng: np.random.Generator) -> Plane:
    """Rows from straight up to straight down, columns by the sideways share of the direction."""
    height = np.linspace(-1, 1, 512, dtype=np.float32)[:, None]
    skyline = 0.12 + 0.10 * rough(rng, (1, 1024), 0.9, 2)
    clutter = np.clip(0.16 + 0.14 * rough(rng, (512, 1024), 1.1, 3), 0.01, 0.8)
    ground = np.clip(0.28 + 0.05 * rough(rng, (512, 1024), 1.1, 2), 0, 1)
    sky = 1.3 - 0.7 * np.clip(-height, 0, 1)
    return np.where(height < -skyline, sky, np.where(height < 0.06, clutter, ground)).astype(np.float32)


def _ribs() -> Plane:
    """Sheet metal with vertical ribs, ten to the picture's width."""
    phase = np.arange(320) / 32 * 2 * np.pi
    wave = 0.72 + 0.22 * np.tanh(2.5 * np.sin(phase))
    return np.repeat(np.resize(wave, 256)[None, :], 8, axis=0).astype(np.float32)


def _boards(rng: np.random.Generator) -> Plane:
    """Horizontal boards: no texture along the rows."""
    plane = np.repeat(0.8 + 0.05 * rng.standard_normal((16, 1)), 16, axis=0)
    plane[::16] = 0.45
    plane[1::16] = 0.6
    return np.repeat(plane, 8, axis=1).astype(np.float32)


def _bricks(rng: np.random.Generator, rows: int, columns: int, joint: float) -> Plane:
    high, wide = 256 // rows, 256 // columns
    shade = 0.8 + 0.07 * rng.standard_normal((rows, columns))
    plane = np.kron(shade, np.ones((high, wide)))
    plane[::high] *= joint
    plane[:, ::wide] *= joint
    for course in range(1, rows, 2):
        part = slice(course * high, (course + 1) * high)
        plane[part] = np.roll(plane[part], wide // 2, axis=1)
    return np.asarray(np.clip(plane, 0, 1), dtype=np.float32)


def _tiles(rng: np.random.Generator) -> Plane:
    """Roof tiles: rows with a dark lower edge, columns with a bulge."""
    u, v = np.meshgrid(np.arange(256), np.arange(256))
    bulge = 0.7 + 0.2 * np.cos(2 * np.pi * (u % 16) / 16)
    edge = np.where(v % 16 < 3, 0.45, 1.0)
    shade = np.kron(1 + 0.06 * rng.standard_normal((16, 16)), np.ones((16, 16)))
    return np.clip(bulge * edge * shade, 0, 1).astype(np.float32)


def _leaves(rng: np.random.Generator, share_of_holes: float) -> Picture:
    shape = rough(rng, (256, 256), 0.8, 5)
    light = np.clip(0.45 + 0.22 * rough(rng, (256, 256), 0.4, 10) + 0.12 * rough(rng, (256, 256), 1.0, 3), 0.04, 1)
    hole = shape < np.quantile(shape, share_of_holes) if share_of_holes else None
    if hole is not None:
        # A card's own outline must not show: leaves end raggedly before its edges.
        u, v = np.meshgrid(np.linspace(-1, 1, 256), np.linspace(-1, 1, 256))
        hole |= np.hypot(u, v) + 0.12 * rough(rng, (256, 256), 1.0, 3) > 0.85
    return Picture(light.astype(np.float32), hole=hole)


def _twigs(rng: np.random.Generator) -> Picture:
    """A fan of thin branches that start at the middle of the lower edge."""
    hole = np.ones((256, 256), dtype=bool)
    for _ in range(26):
        angle, length = rng.uniform(-1.1, 1.1), rng.uniform(90, 240)
        bow = rng.uniform(-0.4, 0.4)
        along = np.linspace(0, 1, 500)
        u = 128 + length * along * np.sin(angle + bow * along)
        v = 255 - length * along * np.cos(angle + bow * along)
        thick = 1 + (along < 0.5)
        for shift in range(3):
            inside = (u + shift < 256) & (u > 0) & (v >= 0) & (shift < thick + 1)
            hole[v[inside].astype(int), (u + shift)[inside].astype(int)] = False
    return Picture(np.full((256, 256), 0.25, np.float32), hole=hole)


def _slats() -> Picture:
    """A fence of sixteen upright slats with gaps, and two rails."""
    u, v = np.meshgrid(np.arange(256), np.arange(128))
    rail = (np.abs(v - 28) < 5) | (np.abs(v - 98) < 5)
    hole = (u % 16 >= 10) & ~rail
    albedo = np.where(u % 16 < 2, 0.55, 0.85) * np.where(rail & (u % 16 >= 10), 0.6, 1.0)
    return Picture(albedo.astype(np.float32), hole=hole)


def _mesh() -> Picture:
    """A fence of thin upright bars: eight to the picture."""
    u, v = np.meshgrid(np.arange(256), np.arange(128))
    bar = (u % 16 < 2) | (v % 42 < 3) | (u % 256 < 5)
    return Picture(np.full((128, 256), 0.5, np.float32), hole=~bar)


def _windows(rng: np.random.Generator, wall: float) -> Picture:
    """Four by four windows in a plastered wall, each a little different behind the glass."""
    albedo = np.full((256, 256), wall, np.float32)
    gloss = np.zeros((256, 256), np.float32)
    glass = np.zeros((256, 256), bool)
    for top in range(0, 256, 64):
        for left in range(0, 256, 64):
            albedo[top + 14 : top + 52, left + 16 : left + 48] = 0.95
            pane = (slice(top + 16, top + 50), slice(left + 18, left + 46))
            albedo[pane] = rng.uniform(0.03, 0.1)
            gloss[pane] = 0.5
            glass[pane] = True
            if rng.random() < 0.6:  # a curtain
                albedo[top + 16 : top + int(rng.integers(22, 50)), left + 18 : left + 46] = rng.uniform(0.3, 0.7)
            albedo[top + 16 : top + 50, left + 31 : left + 33] = 0.9
            albedo[top + 52 : top + 54, left + 13 : left + 51] = 0.4
    return Picture(albedo, gloss, glass=glass)


def _shopfront(rng: np.random.Generator) -> Picture:
    """Two large panes with things behind them, a door between, a dark band above."""
    albedo = np.full((128, 256), 0.5, np.float32)
    gloss = np.zeros((128, 256), np.float32)
    albedo[:22] = 0.25
    for left, right in ((8, 104), (112, 144), (152, 248)):
        pane = (slice(28, 116), slice(left, right))
        albedo[pane] = np.clip(0.1 + 0.07 * rough(rng, (88, right - left), 0.9), 0.01, 0.5)
        gloss[pane] = 0.5
    return Picture(albedo, gloss)


def _lettering(rng: np.random.Generator) -> Plane:
    blocks = rng.random((8, 16)) < 0.5
    blocks[[0, -1]] = False
    blocks[:, [0, -1]] = False
    return np.where(np.kron(blocks, np.ones((8, 8))) > 0, 0.15, 0.9).astype(np.float32)


def _far(rng: np.random.Generator) -> Picture:
    """Treetops and roofs at the end of the street; nothing above them."""
    skyline = 70 + 26 * rough(rng, (1, 512), 0.9, 2)
    v = np.arange(128)[:, None]
    light = np.clip(0.3 + 0.16 * rough(rng, (128, 512), 0.6, 4), 0.05, 0.9)
    return Picture(light, hole=np.asarray(v < skyline - 40))


def _gable() -> Picture:
    """A triangle standing on its longest side."""
    u, v = np.meshgrid(np.linspace(-1, 1, 128), np.linspace(0, 1, 128))
    return Picture(np.full((128, 128), 0.85, np.float32), hole=np.asarray(np.abs(u) > v))


def tree_shadow(rng: np.random.Generator, texels: int) -> Plane:
    """(texels, texels) share of sunlight under a crown that fills the square."""
    gaps: NDArray[np.float32] = smoothed(rough(rng, (texels, texels), 0.7, 4), 1)
    u, v = np.meshgrid(np.linspace(-1, 1, texels), np.linspace(-1, 1, texels))
    rim = np.hypot(u, v) + 0.15 * rough(rng, (texels, texels), 1.0, 2)
    return np.where((gaps > 0.9) | (rim > 0.9), 1.0, 0.0).astype(np.float32)

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from auditor.lab.simulation import raycasting
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.raycasting import Hits, Rays, cast, placed
from auditor.lab.simulation.surfaces import Piece, gather
from auditor.lab.simulation.textures import SIZE, Atlas, Tile, level_of, make_atlas
from auditor.lab.simulation.vehicles import camera_rays
from auditor.model.optics.geometry import motion
from auditor.model.optics.sensors import Lens
from auditor.model.rig import Camera

FOCAL = 100.0


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return make_atlas(np.random.default_rng(0))


def rays() -> Rays:
    projection = np.array([[FOCAL, 0, 60, 0], [0, FOCAL, 40, 0], [0, 0, 1, 0]])
    return camera_rays(Camera(1, "camera", "/camera", 121, 81, projection))


def look_at(atlas: Atlas, *pieces: Piece) -> Hits:
    return cast(rays(), gather(pieces, np.random.default_rng(0)), atlas)


def wall(z_m: float = 10.0, **more: object) -> Piece:
    """Two metres wide and two high, straight ahead."""
    return Piece((-1, 1, z_m), (2, 0, 0), (0, -2, 0), Tile.PLASTER, **more)  # type: ignore[arg-type]


def test_a_wall_covers_its_rectangle_at_its_distance(atlas: Atlas) -> None:
    hits = look_at(atlas, wall())
    row, column = np.nonzero(hits.piece == 0)
    assert (row.min(), row.max(), column.min(), column.max()) == (30, 50, 50, 70)
    assert row.size == 21 * 21
    np.testing.assert_allclose(hits.distance[row, column], 10, rtol=1e-5)
    assert np.isinf(hits.distance[0, 0])
    np.testing.assert_allclose(hits.s[40, 50:71], np.linspace(0, 1, 21), atol=1e-5)
    np.testing.assert_allclose(hits.t[30:51, 60], np.linspace(1, 0, 21), atol=1e-5)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_wall_hides_the_farther_one_in_any_order(atlas: Atlas, order: tuple[int, int]) -> None:
    walls = (wall(5.0), wall(10.0))
    hits = look_at(atlas, *(walls[at] for at in order))
    assert hits.distance[40, 60] == pytest.approx(5)


def test_level_ground_that_begins_behind_the_camera_is_seen_up_to_the_horizon(atlas: Atlas) -> None:
    ground = Piece((-50, 1.5, -10), (100, 0, 0), (0, 0, 110), Tile.ASPHALT)
    hits = look_at(atlas, ground)
    assert hits.distance[80, 60] == pytest.approx(1.5 * FOCAL / 40, rel=1e-4)
    assert (hits.piece[43:] == 0).all()
    assert (hits.piece[:40] == -1).all()


def test_a_trapezoid_an_oval_and_a_cut_piece_cover_less(atlas: Atlas) -> None:
    whole = np.count_nonzero(look_at(atlas, wall()).piece == 0)
    tapered = np.count_nonzero(look_at(atlas, wall(taper=0.25)).piece == 0)
    oval = np.count_nonzero(look_at(atlas, wall(oval=True)).piece == 0)
    leaves = Piece((-1, 1, 10), (2, 0, 0), (0, -2, 0), Tile.LEAVES, cut=True)
    cut = np.count_nonzero(look_at(atlas, leaves).piece == 0)
    assert tapered == pytest.approx(0.75 * whole, rel=0.05)
    assert oval == pytest.approx(np.pi * 10**2, rel=0.03)
    assert 0.2 * whole < cut < 0.65 * whole


def test_only_a_lidar_looks_through_glass(atlas: Atlas) -> None:
    glass = Piece((-1, 1, 10), (2, 0, 0), (0, -2, 0), Tile.GLASS, (2, 2), see_through=0.5)
    table = gather([glass], np.random.default_rng(0))
    seen = np.count_nonzero(cast(rays(), table, atlas).piece == 0)
    scanned = np.count_nonzero(cast(rays(), table, atlas, np.random.default_rng(1)).piece == 0)
    assert seen == 21 * 21
    assert 0.4 * seen < scanned < 0.75 * seen


def test_pieces_move_with_their_speed_and_against_the_vehicle(atlas: Atlas) -> None:
    table = gather([wall(10.0, speed=4.0)], np.random.default_rng(0))
    rig_SE3_world = motion(np.eye(3), np.array([0.0, 0.0, -3.0]))
    hits = cast(rays(), placed(table, rig_SE3_world, 0.5), atlas)
    assert hits.distance[40, 60] == pytest.approx(10 + 4 * 0.5 - 3)


def test_textures_are_periodic_and_their_reductions_keep_the_mean(atlas: Atlas) -> None:
    rng = np.random.default_rng(2)
    s, t = rng.random((2, 500), dtype=np.float32)
    here = atlas.bilinear(Tile.ASPHALT, s, t, 0)
    np.testing.assert_allclose(here, atlas.bilinear(Tile.ASPHALT, s + 3, t - 2, 0), atol=2e-3)
    coarsest = atlas.bilinear(Tile.ASPHALT, s, t, 8)
    assert np.ptp(coarsest) < 1e-5
    assert coarsest[0] == pytest.approx(here.mean(), abs=0.03)
    assert np.std(here) > 3 * np.std(atlas.bilinear(Tile.ASPHALT, s, t, 5))


def test_the_reduction_fits_the_footprint() -> None:
    footprints = np.array([0.1, 1, 2, 4.1, 1e9], dtype=np.float32) / SIZE
    assert level_of(footprints).tolist() == [0, 0, 1, 2, 8]


def test_a_lidar_meets_what_it_meets_where_every_beam_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = make_drive(5, 10, vehicle=3, width_px=40, height_px=12)
    bounded = drive.cloud(2).xyz_m
    tried, bounds = [], raycasting._beams

    def every_beam(rays: Rays, corners: NDArray[np.float32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        first, last = bounds(rays, corners)
        tried.append((last - first).mean())
        return np.zeros(len(corners), dtype=np.int32), np.full(len(corners), rays.shape[0], dtype=np.int32)

    monkeypatch.setattr(raycasting, "_beams", every_beam)
    assert np.array_equal(drive.cloud(2).xyz_m, bounded)
    assert tried[0] < 16, "most beams pass most pieces by"


@pytest.mark.parametrize("lens", [None, Lens("plumb_bob", (-0.2, 0.05, 0.001, 0.0, 0.0))])
def test_pieces_met_together_are_met_as_one_after_the_other(monkeypatch: pytest.MonkeyPatch, lens: Lens | None) -> None:
    drive = make_drive(5, 10, width_px=310, height_px=94)
    camera = drive.rig.camera(2)
    if lens is not None:
        camera = replace(camera, lens=lens, rectified=False)
    forward = motion(np.eye(3), np.array([0.0, 1.65, -6.0]))
    surfaces, grids = placed(drive.surfaces, forward, 0.4), []
    for few in (0, 2000, 10**9):
        monkeypatch.setattr(raycasting, "_FEW", few)
        grids.append(cast(camera_rays(camera), surfaces, drive.atlas))
    assert np.unique(grids[0].piece).size > 100
    for together in grids[1:]:
        for name in ("piece", "s", "t", "distance"):
            assert np.array_equal(getattr(grids[0], name), getattr(together, name))

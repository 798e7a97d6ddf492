"""A street in colour: its materials, the light of a day, and cameras that do not all have one spectrum."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from auditor.lab.simulation.conditions import CAMERAS, FLARE
from auditor.lab.simulation.daylight import Day
from auditor.lab.simulation.rays import Hits, Rays
from auditor.lab.simulation.responses import ExposureChange, Response, changed_exposure, developed
from auditor.lab.simulation.spectral_shading import Channels, channels, spectral_radiance
from auditor.lab.simulation.stray_light import SunSeen
from auditor.lab.simulation.surfaces import Surfaces
from auditor.lab.simulation.textures import Atlas
from auditor.lab.simulation.vehicles import CameraFlaws
from auditor.model.arrays import Floats32, Image
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera

_PREVIEW = 6  # every so many pixels decide about the exposure
_EXPOSURES = 1 / 64, 64.0
_HALVINGS = 20

View = tuple[Matrix, Rays, Surfaces, Hits]
"""The rig's pose, a camera's rays, the pieces in the rig frame, and the hits."""


@dataclass(frozen=True, eq=False)
class Scenery:
    """The spectral part of a drive: `reflectance` and `emission` are (N, LAYERS, 4), of its pieces; see `spectra`."""

    condition: str
    day: Day
    road_m: float
    reflectance: Floats32
    emission: Floats32 | None
    responses: tuple[Response, ...]
    changes: tuple[ExposureChange, ...]

    @cached_property
    def channels(self) -> tuple[Channels, ...]:
        """Of S_1, S_2, ..."""
        return tuple(channels(one.bands, self.reflectance, self.emission, self.day) for one in self.responses)

    def light(self, camera: int, view: View, atlas: Atlas) -> Floats32:
        """(K, H, W) radiances in the channels of S_camera."""
        world_SE3_rig, rays, surfaces, hits = view
        seen = self.channels[camera - 1]
        return spectral_radiance(rays, hits, surfaces, atlas, self.day, self.road_m, seen, world_SE3_rig)

    def pixels(
        self,
        camera: Camera,
        view: View,
        atlas: Atlas,
        flaws: CameraFlaws,
        metered: Floats32,
        time_s: float,
        rng: np.random.Generator,
    ) -> Image:
        """The image of a camera, (H, W) or (H, W, 3) BGR; `metered` are the (K,) exposures that suit the drive."""
        response = self.responses[camera.number - 1]
        changed = response.exposure * changed_exposure(self.changes, camera.number, time_s)
        exposure = metered * response.balance(time_s) * np.float32(changed)
        light = self.light(camera.number, view, atlas)
        sun = self.sun_seen(camera, view)
        return developed(light, flaws, response, exposure, sun, rng)

    def metered(self, camera: int, preview: View, atlas: Atlas) -> Floats32:
        """The (K,) exposures that give S_camera a picture of the day's mean level, nearly grey on the whole."""
        light = self.light(camera, preview, atlas)
        mean = np.minimum(light, 1).mean(axis=(1, 2))
        balance = np.clip(mean.mean() / mean, *CAMERAS.grey_world_limits) ** np.float32(CAMERAS.grey_world)
        light *= balance[:, None, None]
        low, high = (float(np.log(limit)) for limit in _EXPOSURES)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            too_dark = float(np.minimum(light * np.float32(np.exp(middle)), 1).mean()) < self.day.level
            low, high = (middle, high) if too_dark else (low, middle)
        return np.asarray(balance * np.float32(np.exp(low)), dtype=np.float32)

    def sun_seen(self, camera: Camera, view: View) -> SunSeen | None:
        """Where a camera sees the sun, and how much of it; None by dusk, and where it is far from the picture."""
        world_SE3_rig, rays, _, hits = view
        if not self.day.glow:
            return None
        x, y, z = camera.rotation @ world_SE3_rig[:3, :3].T @ np.array(self.day.light.sun)
        if z <= 0:
            return None
        u, v, _ = camera.intrinsics @ np.array([x / z, y / z, 1])
        height, width = rays.shape
        if not (0 <= u < width and 0 <= v < height):
            far = max(abs(u - width / 2), abs(v - height / 2)) > FLARE.reach * width / 2
            return None if far else SunSeen(float(u), float(v), FLARE.outside)
        half = FLARE.window_px // 2
        window = hits.piece[max(int(v) - half, 0) : int(v) + half + 1, max(int(u) - half, 0) : int(u) + half + 1]
        return SunSeen(float(u), float(v), float(np.mean(window < 0)))


def smaller(camera: Camera) -> Camera:
    """The camera with fewer pixels, to meter by."""
    scale = np.diag([1 / _PREVIEW, 1 / _PREVIEW, 1])
    return replace(
        camera,
        width_px=camera.width_px // _PREVIEW,
        height_px=camera.height_px // _PREVIEW,
        projection=scale @ camera.projection,
    )

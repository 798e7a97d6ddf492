"""How cameras answer to light: their bands, tone curves, exposure and white balance over time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle, islice
from typing import Literal

import numpy as np

from auditor.lab.simulation.conditions import CAMERAS, EXPOSURE, KINDS, Range
from auditor.lab.simulation.stray_light import LensFlare, SunSeen, draw_lens, with_stray_light
from auditor.lab.simulation.vehicles import CameraFlaws, blurred, vignette
from auditor.model.arrays import Floats, Floats32, Image

CameraKind = Literal["grey", "colour"]

_MIXED_THREE: tuple[CameraKind, ...] = ("grey", "colour", "colour")
_BRIGHTEST = 4.0  # of the light that a lens spreads, of white
_WHITE = 255.0
_STEPS = 4096
_CURVE_END = 2.0  # exposed light beyond is white whatever the curve
_RED, _BLUE = 2, 0


@dataclass(frozen=True, eq=False)
class Response:
    """One camera: K channels of four bands (K, 4); its tone curve from exposed light to grey levels; its lens.

    `exposure` is its factor against the other cameras; white balance drifts by `drift` (logarithms of blue and red) in
    `drift_s` seconds.
    """

    bands: Floats
    gamma: float
    knee: float
    slope: float
    black: float
    exposure: float
    vignetting: float
    drift: tuple[float, float]
    drift_s: float
    phase: float
    lens: LensFlare

    @cached_property
    def curve(self) -> Image:
        """Grey levels of exposed light, evenly from 0 to 2."""
        light = np.linspace(0, _CURVE_END, _STEPS)
        level = light**self.gamma
        level = np.where(level > self.knee, self.knee + (level - self.knee) * self.slope, level)
        return np.rint(np.clip(self.black + (1 - self.black) * level, 0, 1) * _WHITE).astype(np.uint8)

    def balance(self, time_s: float) -> Floats32:
        """(K,) factors of the white balance at a time."""
        factors = np.ones(len(self.bands), dtype=np.float32)
        if len(factors) > 1:
            wave = np.sin(2 * np.pi * time_s / self.drift_s + self.phase) - np.sin(self.phase)
            factors[[_BLUE, _RED]] = np.exp(np.array(self.drift) * wave)
        return factors


def kinds_of(vehicle: int, cameras: int) -> tuple[CameraKind, ...]:
    """The kinds of S_1, S_2, ... of a vehicle: all grey, all colour, or mixed.

    Mixed ones are grey and colour in turn from a grey S_1, as KITTI's four; KITTI's three lack the second grey one.
    """
    drawn = np.random.default_rng([vehicle, 11]).random()
    if drawn >= KINDS.mixed:
        return ("grey" if drawn < KINDS.mixed + KINDS.grey else "colour",) * cameras
    return _MIXED_THREE if cameras == len(_MIXED_THREE) else tuple(islice(cycle(_MIXED_THREE[:2]), cameras))


def draw_responses(kinds: Sequence[CameraKind], vehicle: int) -> tuple[Response, ...]:
    """The cameras of a vehicle: those of one kind are one model."""
    of_model = {kind: _draw_model(kind, np.random.default_rng([vehicle, 12, len(kind)])) for kind in sorted(set(kinds))}
    return tuple(_unit(of_model[kind], np.random.default_rng([vehicle, 13, n])) for n, kind in enumerate(kinds))


def _draw_model(kind: CameraKind, rng: np.random.Generator) -> Response:
    bands = _grey(rng) if kind == "grey" else _colour(rng)
    knee = rng.random() < CAMERAS.knees
    straight = rng.random() < CAMERAS.straight
    return Response(
        bands=bands,
        gamma=1.0 if straight else float(rng.uniform(*CAMERAS.gamma)),
        knee=float(rng.uniform(*CAMERAS.knee)) if knee else 1.0,
        slope=float(rng.uniform(*CAMERAS.knee_slope)) if knee else 1.0,
        black=float(rng.uniform(*CAMERAS.black)),
        exposure=_log_uniform(CAMERAS.exposure, rng),
        vignetting=float(rng.uniform(*CAMERAS.vignetting)),
        drift=(0.0, 0.0),
        drift_s=1.0,
        phase=0.0,
        lens=draw_lens(rng),
    )


def _unit(model: Response, rng: np.random.Generator) -> Response:
    """One camera of a model."""
    spread = np.exp(rng.normal(0, CAMERAS.unit_spread, model.bands.shape))
    drift = float(rng.uniform(*CAMERAS.drift))
    return replace(
        model,
        bands=model.bands * spread,
        black=max(0.0, model.black + float(rng.normal(0, 1)) / _WHITE),
        exposure=model.exposure * float(np.exp(rng.normal(0, CAMERAS.unit_spread))),
        drift=(drift * float(rng.uniform(-1, 1)), drift * float(rng.uniform(-1, 1))),
        drift_s=float(rng.uniform(*CAMERAS.drift_s)),
        phase=float(rng.uniform(0, 2 * np.pi)),
        lens=draw_lens(rng),
    )


def _grey(rng: np.random.Generator) -> Floats:
    infrared, red, blue = (rng.uniform(*r) for r in (CAMERAS.infrared, CAMERAS.red, CAMERAS.blue))
    visible = (1 - infrared) * np.array([blue, 1 - blue - red, red])
    return np.append(visible, infrared)[None, :]


def _colour(rng: np.random.Generator) -> Floats:
    near, leak = rng.uniform(*CAMERAS.crosstalk, 3), rng.uniform(*CAMERAS.leak, 3)
    bands = np.zeros((3, 4))
    for k in range(3):
        for beside in (k - 1, k + 1):
            if 0 <= beside < 3:
                bands[k, beside] = near[k]
        bands[k, 3] = leak[k]
        bands[k, k] = 1 - bands[k].sum()
    bands[[_BLUE, _RED]] *= rng.uniform(*CAMERAS.balance, 2)[:, None]
    return bands


def _log_uniform(limits: Range, rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))


@dataclass(frozen=True)
class ExposureChange:
    """From `start_s` on and within `ramp_s` the exposure changes by a factor, of one camera or of all (None)."""

    start_s: float
    ramp_s: float
    factor: float
    camera: int | None


def draw_changes(cameras: int, duration_s: float, rng: np.random.Generator) -> tuple[ExposureChange, ...]:
    """The changes of exposure during a drive."""
    changes = []
    for section in range(int(duration_s // EXPOSURE.section_s) + 1):
        for probability, camera in ((EXPOSURE.together, None), (EXPOSURE.alone, int(rng.integers(1, cameras + 1)))):
            share, ramp, factor = rng.random(), rng.uniform(*EXPOSURE.ramp_s), _log_uniform(EXPOSURE.factor, rng)
            if rng.random() < probability:
                start_s = section * EXPOSURE.section_s + share * min(EXPOSURE.section_s, duration_s)
                changes.append(ExposureChange(float(start_s), float(ramp), factor, camera))
    return tuple(changes)


def changed_exposure(changes: Sequence[ExposureChange], camera: int, time_s: float) -> float:
    """The factor of a camera's exposure at a time."""
    logarithm = sum(
        float(np.log(one.factor)) * min(max((time_s - one.start_s) / max(one.ramp_s, 1e-3), 0.0), 1.0)
        for one in changes
        if one.camera in (None, camera)
    )
    return float(np.clip(np.exp(logarithm), *EXPOSURE.bounds))


def developed(
    light: Floats32,
    flaws: CameraFlaws,
    response: Response,
    exposure: Floats32,
    sun: SunSeen | None,
    rng: np.random.Generator,
) -> Image:
    """(K, H, W) radiances to grey levels, (H, W) or (H, W, 3) BGR: lens, exposure, noise, tone curve; `light` changes.

    An `exposure` (K,) of 1 makes a radiance of 1 white. More of it comes with more noise, as a sensor's gain does.
    """
    light *= exposure[:, None, None]
    np.minimum(light, np.float32(_BRIGHTEST), out=light)
    with_stray_light(light, response.lens, sun)
    gain = max(float(exposure.mean()), 1.0)
    read = np.float32(flaws.read_noise * gain**CAMERAS.noise_gain / _WHITE)
    photon = np.float32(flaws.photon_noise * gain / _WHITE)
    height, width = light.shape[1:]
    bright = vignette(height, width, response.vignetting)
    pixels = np.empty((height, width, len(light)), dtype=np.uint8)
    for k, channel in enumerate(light):
        image = blurred(blurred(channel, flaws.blur).T, flaws.blur).T * bright
        image += np.sqrt(read * read + photon * image) * rng.standard_normal((height, width), dtype=np.float32)
        place = np.clip(image * np.float32(_STEPS / _CURVE_END), 0, _STEPS - 1).astype(np.int16)
        pixels[:, :, k] = response.curve.take(place)
    return pixels if len(light) > 1 else pixels[:, :, 0]

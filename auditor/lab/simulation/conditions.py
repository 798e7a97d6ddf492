"""The ranges from which the light, the materials and the cameras of a spectral street are drawn.

They are scenery: no count and no verdict depends on them. A pair is a range that is drawn from evenly. Four numbers of
a spectrum are those of blue, green, red and near infrared (about 450, 550, 620 and 700 to 950 nm).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from auditor.errors import SettingError
from auditor.model.parameters import BY_HAND, parameter

Range = tuple[float, float]
Spectrum = tuple[float, float, float, float]

_REFLECTANCE = "by hand, after the shapes of published reflectance spectra; no experiment recorded"
_KITTI = "by hand, so that ratios of materials are like KITTI's; spectral_realism of commit b4d652d9 prints both"


@dataclass(frozen=True)
class Condition:
    """One kind of light and weather. Strengths of light are radiances of a white surface, before exposure."""

    elevation_deg: Range = parameter((30.0, 60.0), unit="degrees of the sun above the horizon", source=BY_HAND)
    azimuth_deg: Range = parameter((-180.0, 180.0), unit="degrees of the sun from straight ahead", source=BY_HAND)
    direct: Range = parameter((1.1, 1.7), unit="radiance, of the sun", source=BY_HAND)
    ambient: Range = parameter((0.2, 0.4), unit="radiance, of the sky", source=BY_HAND)
    sky: Range = parameter((0.9, 1.6), unit="radiance of the sky near the horizon", source=BY_HAND)
    blue: Range = parameter((0.6, 1.0), unit="share of blue in the sky's light, 0 overcast", source=BY_HAND)
    glow: Range = parameter((0.0, 0.5), unit="radiance of the sky beside the sun", source=BY_HAND)
    shade: Range = parameter((0.75, 0.97), unit="share of the sun's light that shade keeps out", source=BY_HAND)
    shade_m: Range = parameter((8.0, 24.0), unit="metres, size of a shadow's tile", source=BY_HAND)
    one_sided: Range = parameter((0.0, 1.5), unit="how much more shade lies on one side, 1 all of it", source=_KITTI)
    wet: Range = parameter((0.0, 0.0), unit="share of the road that is covered by water", source=BY_HAND)
    lamps: Range = parameter((0.0, 0.0), unit="radiance of a white road below a lamp", source=BY_HAND)
    emitted: Range = parameter((0.0, 0.0), unit="radiance of lamps and lit windows", source=BY_HAND)
    trees: float = parameter(0.0, unit="the least probability of a tree or a bush a section", source=BY_HAND)
    level: Range = parameter((0.26, 0.42), unit="mean of a picture that exposure aims at, before tone", source=_KITTI)


CONDITIONS: Mapping[str, Condition] = MappingProxyType(
    {
        "clear": Condition(),
        "overcast": Condition(
            direct=(0.0, 0.15), ambient=(0.8, 1.1), sky=(1.6, 2.6), blue=(0.0, 0.2), glow=(0.0, 0.0),
            shade=(0.3, 0.6), one_sided=(0.0, 0.3),
        ),
        "low sun": Condition(
            elevation_deg=(5.0, 14.0), azimuth_deg=(-15.0, 15.0), direct=(1.2, 2.2), ambient=(0.15, 0.3),
            sky=(0.8, 1.4), blue=(0.2, 0.6), glow=(2.0, 6.0), one_sided=(0.0, 0.6),
        ),
        "wet": Condition(
            direct=(0.0, 0.7), ambient=(0.5, 0.9), sky=(1.3, 2.4), blue=(0.0, 0.4), shade=(0.3, 0.8),
            wet=(0.15, 0.7), emitted=(0.0, 1.5),
        ),
        "dusk": Condition(
            elevation_deg=(20.0, 40.0), direct=(0.0, 0.01), ambient=(0.05, 0.12), sky=(0.12, 0.4), blue=(0.5, 1.0),
            glow=(0.0, 0.0), one_sided=(0.0, 0.0), wet=(0.0, 0.4), lamps=(0.05, 0.3), emitted=(1.0, 3.0),
            level=(0.14, 0.26),
        ),
        "foliage": Condition(
            sky=(1.6, 3.2), blue=(0.0, 0.8), shade=(0.9, 0.99), ambient=(0.12, 0.25), one_sided=(0.3, 1.5), trees=0.9,
        ),
    }
)  # fmt: skip
"""Conditions by name. Each, with a style of street, is a family: what it teaches can be left out as a whole."""


@dataclass(frozen=True)
class Materials:
    """Reflectances by band, as multiples of a surface's grey albedo; the bands share one brightness to the eye."""

    asphalt: Spectrum = parameter((0.92, 1.0, 1.05, 1.15), unit="multiples of the albedo", source=_REFLECTANCE)
    stone: Spectrum = parameter((0.88, 1.0, 1.08, 1.2), unit="multiples of the albedo", source=_REFLECTANCE)
    brick: Spectrum = parameter((0.45, 0.8, 1.6, 2.2), unit="multiples of the albedo", source=_REFLECTANCE)
    bark: Spectrum = parameter((0.7, 0.95, 1.2, 2.0), unit="multiples of the albedo", source=_REFLECTANCE)
    green: Spectrum = parameter((0.5, 1.15, 0.75, 9.0), unit="multiples of the albedo", source=_REFLECTANCE)
    autumn: Spectrum = parameter((0.35, 0.9, 1.5, 6.0), unit="multiples of the albedo", source=_REFLECTANCE)
    dry: Spectrum = parameter((0.6, 1.0, 1.25, 3.0), unit="multiples of the albedo", source=_REFLECTANCE)
    tail_lamp: Spectrum = parameter((0.15, 0.2, 2.6, 2.6), unit="multiples of the albedo", source=_REFLECTANCE)
    green_share: float = parameter(0.65, unit="probability that a plant is green; else autumn or dry", source=BY_HAND)
    plant_infrared: Range = parameter((0.6, 1.4), unit="factor of a plant's near infrared", source=_REFLECTANCE)
    saturated_paint: float = parameter(0.5, unit="probability that a car has a colour", source=BY_HAND)
    saturated_front: float = parameter(0.45, unit="probability that a front or fence has a colour", source=BY_HAND)
    paint_saturation: Range = parameter((0.5, 0.95), unit="saturation of a car's or sign's colour", source=BY_HAND)
    front_saturation: Range = parameter((0.1, 0.5), unit="saturation of a front's colour", source=BY_HAND)
    dye_infrared: Range = parameter((0.6, 3.0), unit="near infrared of dyed surfaces, of the albedo", source=BY_HAND)
    spread: float = parameter(0.05, unit="standard deviation of each band's logarithm", source=BY_HAND)
    clay_roofs: float = parameter(0.6, unit="probability that a roof is of clay; else neutral", source=BY_HAND)
    brightest: float = parameter(0.95, unit="the largest visible reflectance", source="no surface reflects more")


@dataclass(frozen=True)
class Illuminants:
    """Spectra of light, 1 in green."""

    sun: Spectrum = parameter((0.92, 1.0, 1.02, 1.0), unit="multiples of green", source=_REFLECTANCE)
    low_sun: Spectrum = parameter((0.6, 1.0, 1.25, 1.5), unit="multiples of green", source=_REFLECTANCE)
    low_deg: float = parameter(20.0, unit="degrees of elevation below which the sun reddens", source=BY_HAND)
    blue_sky: Spectrum = parameter((1.45, 1.0, 0.7, 0.5), unit="multiples of green", source=_REFLECTANCE)
    clouds: Spectrum = parameter((1.02, 1.0, 0.97, 0.85), unit="multiples of green", source=_REFLECTANCE)
    blue_up: float = parameter(3.0, unit="tangent of the elevation where a sky is blue, as a factor", source=BY_HAND)
    glow_deg: float = parameter(7.0, unit="degrees from the sun within which its glow falls to 1 / e", source=BY_HAND)
    sodium: Spectrum = parameter((0.15, 0.8, 1.5, 0.9), unit="multiples of green", source=_REFLECTANCE)
    white_lamp: Spectrum = parameter((1.0, 1.0, 0.95, 0.05), unit="multiples of green", source=_REFLECTANCE)


@dataclass(frozen=True)
class CameraRanges:
    """Cameras of one vehicle: those of one kind are one model, whose units differ a little."""

    infrared: Range = parameter((0.12, 0.35), unit="share of near infrared in a grey camera's white", source=_KITTI)
    red: Range = parameter((0.25, 0.4), unit="share of red in what is left of it", source=BY_HAND)
    blue: Range = parameter((0.1, 0.3), unit="share of blue in what is left of it", source=BY_HAND)
    crosstalk: Range = parameter((0.02, 0.12), unit="share of a neighbouring band in a colour channel", source=BY_HAND)
    leak: Range = parameter((0.0, 0.05), unit="share of near infrared in a colour channel", source=BY_HAND)
    balance: Range = parameter((0.85, 1.18), unit="factor of blue and red against a neutral white", source=BY_HAND)
    grey_world: float = parameter(0.7, unit="share of a picture's cast that white balance takes away", source=BY_HAND)
    grey_world_limits: Range = parameter((0.6, 1.7), unit="factors, its limits", source=BY_HAND)
    drift: Range = parameter((0.0, 0.1), unit="amplitude of the white balance's drift, as a logarithm", source=BY_HAND)
    drift_s: Range = parameter((3.0, 20.0), unit="seconds of a period of the drift", source=BY_HAND)
    unit_spread: float = parameter(0.02, unit="standard deviation of a unit's sensitivity, relative", source=BY_HAND)
    gamma: Range = parameter((0.45, 1.0), unit="exponent of the tone curve", source=BY_HAND)
    straight: float = parameter(0.4, unit="probability of an exponent of 1", source=BY_HAND)
    knee: Range = parameter((0.5, 0.85), unit="level above which a tone curve is flatter", source=BY_HAND)
    knee_slope: Range = parameter((0.25, 0.7), unit="slope there, against that below", source=BY_HAND)
    knees: float = parameter(0.5, unit="probability of a knee", source=BY_HAND)
    black: Range = parameter((0.0, 0.03), unit="black level, share of white", source=BY_HAND)
    exposure: Range = parameter((0.7, 1.4), unit="factor between cameras, even in its logarithm", source=BY_HAND)
    vignetting: Range = parameter((0.05, 0.35), unit="loss of light at the picture's left and right", source=BY_HAND)
    noise_gain: float = parameter(0.5, unit="exponent of the exposure in read noise", source=BY_HAND)
    veil: Range = parameter(
        (0.002, 0.03), unit="share of all light that a lens spreads over the picture", source=BY_HAND
    )
    veil_px: float = parameter(160.0, unit="pixels of a 1242 px wide picture; the veil's width", source=BY_HAND)
    bloom: Range = parameter((0.0, 0.08), unit="share of light that stays near where it falls", source=BY_HAND)
    bloom_px: float = parameter(9.0, unit="pixels of a 1242 px wide picture; the bloom's width", source=BY_HAND)


@dataclass(frozen=True)
class FlareRanges:
    """What the sun's light does in a lens while the sun is visible. Levels are shares of white, after exposure."""

    ghosts: tuple[int, int] = parameter((3, 8), unit="number of ghosts", source=BY_HAND)
    place: Range = parameter((-1.4, 0.8), unit="of a ghost, times the way from the middle to the sun", source=BY_HAND)
    radius_px: Range = parameter((8.0, 70.0), unit="pixels of a 1242 px wide picture", source=BY_HAND)
    ghost: Range = parameter((0.01, 0.16), unit="level of a ghost", source=BY_HAND)
    tint: Range = parameter((0.4, 1.0), unit="factor of each channel of a ghost", source=BY_HAND)
    glare: Range = parameter((0.05, 0.6), unit="level of the glare beside the sun", source=BY_HAND)
    glare_px: Range = parameter(
        (60.0, 260.0), unit="pixels of a 1242 px wide picture; the glare's width", source=BY_HAND
    )
    window_px: int = parameter(9, unit="pixels: width of the sun where its visible share is counted", source=BY_HAND)
    outside: float = parameter(0.25, unit="share of the flare while the sun is outside of the picture", source=BY_HAND)
    reach: float = parameter(1.5, unit="half picture widths beyond which the sun makes no flare", source=BY_HAND)


@dataclass(frozen=True)
class ExposureRanges:
    """Changes of exposure over time, drawn for each section of `section_s` seconds."""

    section_s: float = parameter(4.0, unit="seconds", source=BY_HAND)
    together: float = parameter(0.5, unit="probability of a change of all cameras a section", source=BY_HAND)
    alone: float = parameter(0.3, unit="probability of a change of one camera a section", source=BY_HAND)
    factor: Range = parameter((0.65, 1.5), unit="factor of a change, even in its logarithm", source=BY_HAND)
    ramp_s: Range = parameter((0.0, 1.5), unit="seconds that a change lasts; a step below one frame", source=BY_HAND)
    bounds: Range = parameter((0.6, 1.6), unit="limits of all changes together, factors", source=BY_HAND)


@dataclass(frozen=True)
class NightAndRain:
    """A wet road, and the lights of a dusk."""

    darker: Range = parameter((0.45, 0.75), unit="factor of a wet surface's albedo", source=BY_HAND)
    puddles: float = parameter(-1.6, unit="power of frequency in the depth of water", source=BY_HAND)
    film: float = parameter(0.05, unit="share of a puddle's mirroring where the ground is only damp", source=BY_HAND)
    gloss: Range = parameter((0.08, 0.3), unit="share of light that water mirrors straight down", source=BY_HAND)
    grazing: Range = parameter(
        (0.3, 0.7), unit="more of it at grazing angles", source="Schlick's approximation; by hand"
    )
    lost: Range = parameter((0.1, 0.4), unit="share of a LiDAR's pulses that damp ground loses", source=BY_HAND)
    mirrored_away: float = parameter(0.9, unit="share of a LiDAR's pulses that puddles lose", source=BY_HAND)
    lamp_spacing_m: Range = parameter((18.0, 35.0), unit="metres between street lamps", source=BY_HAND)
    lamp_height_m: float = parameter(6.0, unit="metres", source=BY_HAND)
    lamp_m: float = parameter(0.35, unit="metres, a lamp's width and height", source=BY_HAND)
    lamp_reach_m: float = parameter(0.8, unit="metres from a lamp to its post", source=BY_HAND)
    nearest_m: float = parameter(3.0, unit="metres from a lamp below which its light grows no further", source=BY_HAND)
    tail_lamp: float = parameter(0.25, unit="radiance of a car's lamps, of a street lamp's", source=BY_HAND)
    window: float = parameter(0.33, unit="radiance of a lit window, of a street lamp's", source=BY_HAND)
    lit_fronts: float = parameter(0.4, unit="probability that a front's windows are lit", source=BY_HAND)


@dataclass(frozen=True)
class KindRanges:
    """Which cameras a vehicle has."""

    mixed: float = parameter(0.6, unit="probability of grey and colour cameras in turn", source=BY_HAND)
    grey: float = parameter(0.2, unit="probability of grey cameras alone; else all are colour", source=BY_HAND)


MATERIALS = Materials()
ILLUMINANTS = Illuminants()
CAMERAS = CameraRanges()
FLARE = FlareRanges()
EXPOSURE = ExposureRanges()
NIGHT_AND_RAIN = NightAndRain()
KINDS = KindRanges()


def condition_named(name: str) -> Condition:
    """One of CONDITIONS. Raises SettingError that lists them."""
    if name not in CONDITIONS:
        raise SettingError(f"there is no condition {name!r}", where="condition", remedy=f"use {', '.join(CONDITIONS)}")
    return CONDITIONS[name]

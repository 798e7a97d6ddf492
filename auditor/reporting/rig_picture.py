"""A rig from above, as an SVG image: where each sensor sits and looks, and what of that is compared with others."""

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import chain, combinations

from auditor.model.rig import LIDAR
from auditor.model.text import one_line
from auditor.reporting.rig_plan import DrawnSensor, PlacedRig, Plan, UnusedLidar, planned

_WIDTH, _HEIGHT = 760, 618
_MIDDLE = _WIDTH / 2, 278.0
_REACH_PX = 168.0
_LABELS_PX = 206.0
_LINE_PX = 15.0
_LEGEND_Y = _HEIGHT - 96
_ROW_PX = 22
_MOST_LETTERS = 96
_MOST_NAME = 26
_CAR_M = 4.6, 1.9
_MOST_SHADES = 3

_STYLE = """
svg { --ink: #17202a; --muted: #55606d; --rule: #c3cbd3; --car: #eef1f4; --paper: #ffffff;
  --one: #bcd9ee; --two: #6fb1de; --more: #0a5a94; --edge: #0a5a94; --lidar: #b8480a; --none: #aab3bd; }
@media (prefers-color-scheme: dark) { svg { --ink: #e7ebef; --muted: #a9b4bf; --rule: #4a5662; --car: #242c34;
  --paper: #1a2027; --one: #1d4a6b; --two: #2f7cb5; --more: #8fcbf5; --edge: #7cbcec; --lidar: #f08a50;
  --none: #66727d; } }
text { font: 13px system-ui, -apple-system, "Segoe UI", "Noto Sans", "Liberation Sans", Arial, sans-serif;
  fill: var(--ink); }
.small { font-size: 12px; fill: var(--muted); }
.car { fill: var(--car); stroke: var(--rule); stroke-width: 1.2; }
.view { stroke: var(--paper); stroke-width: 0.6; fill-opacity: 0.82; }
.by0 { fill: url(#none); } .by1 { fill: var(--one); } .by2 { fill: var(--two); } .by3 { fill: var(--more); }
.edge { fill: none; stroke: var(--edge); stroke-width: 1.3; stroke-linejoin: round; }
.camera { fill: var(--edge); stroke: var(--paper); stroke-width: 1; }
.lidar { fill: var(--lidar); stroke: var(--paper); stroke-width: 1.2; }
.reach { fill: none; stroke: var(--lidar); stroke-width: 1.1; stroke-dasharray: 2 5; stroke-linecap: round; }
.pair { stroke: var(--lidar); stroke-width: 2; }
.beside { font-size: 12px; paint-order: stroke; stroke: var(--paper); stroke-width: 4px; stroke-linejoin: round; }
.unused { fill: var(--paper); stroke: var(--lidar); stroke-width: 1.6; }
.lead { stroke: var(--rule); stroke-width: 1; fill: none; }
.hatch { stroke: var(--none); stroke-width: 1.4; }
""".strip()


def rig_picture(rigs: Sequence[PlacedRig], unused: Sequence[UnusedLidar] = ()) -> str:
    """An SVG image of all rigs of a recording, from above. Ahead is up, where that is known. All text is escaped."""
    plan = planned(rigs, unused)
    everything = (*plan.cameras, *plan.lidars, *plan.unused)
    far_m = max((math.hypot(one.ahead_m, one.left_m) for one in everything), default=0.0)
    scale = _REACH_PX / max(2.2 * far_m, 6.5)
    where = ", ahead is up" if plan.headed else ""
    summary = f"{len(plan.cameras)} cameras and {len(plan.lidars) + len(plan.unused)} LiDARs from above"
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
            f'height="{_HEIGHT}" role="img">',
            f"<title>{summary}{where}; views stand out where more is compared</title>",
            f"<style>{_STYLE}</style>",
            '<defs><pattern id="none" width="7" height="7" patternUnits="userSpaceOnUse" '
            'patternTransform="rotate(45)"><path class="hatch" d="M0 0V7"/></pattern></defs>',
            *_car(everything, scale, headed=plan.headed),
            *_reach(plan),
            *_views_of(plan, scale),
            *_pairs(plan, scale),
            *(_dot(one, scale, "lidar", 6) for one in plan.lidars),
            *(_dot(one, scale, "unused", 5) for one in plan.unused),
            *(_dot(one, scale, "camera", 3.6) for one in plan.cameras),
            *_labels(plan, scale),
            *_lidar_labels(plan, scale),
            *_legend(plan),
            "</svg>\n",
        )
    )


def _at(sensor: DrawnSensor, scale: float) -> tuple[float, float]:
    return _MIDDLE[0] - sensor.left_m * scale, _MIDDLE[1] - sensor.ahead_m * scale


def _towards(deg: float, radius_px: float) -> tuple[float, float]:
    return -radius_px * math.sin(math.radians(deg)), -radius_px * math.cos(math.radians(deg))


def _rim(sensor: DrawnSensor, deg: float, scale: float) -> tuple[float, float]:
    """Where a ray of a sensor meets the circle about the middle that all views end at."""
    x, y = _at(sensor, scale)
    dx, dy = _towards(deg, 1.0)
    ox, oy = x - _MIDDLE[0], y - _MIDDLE[1]
    along = -(ox * dx + oy * dy)
    far = along + math.sqrt(max(along**2 - (ox**2 + oy**2) + _REACH_PX**2, 0.0))
    return x + far * dx, y + far * dy


def _car(everything: Sequence[DrawnSensor], scale: float, *, headed: bool) -> Iterator[str]:
    length_m = max(_CAR_M[0], 1.2 + max((2 * abs(one.ahead_m) for one in everything), default=0.0))
    width_m = max(_CAR_M[1], 0.3 + max((2 * abs(one.left_m) for one in everything), default=0.0))
    width, length = width_m * scale, length_m * scale
    x, y = _MIDDLE[0] - width / 2, _MIDDLE[1] - length / 2
    round_px = width * 0.28
    yield f'<rect class="car" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{length:.1f}" rx="{round_px:.1f}"/>'
    if not headed:
        return
    yield (
        f'<path class="lead" d="M{x + width * 0.16:.1f} {y + length * 0.27:.1f}Q{_MIDDLE[0]:.1f} '
        f'{y + length * 0.2:.1f} {x + width * 0.84:.1f} {y + length * 0.27:.1f}"/>'
    )


def _reach(plan: Plan) -> Iterator[str]:
    if plan.lidars:
        yield f'<circle class="reach" cx="{_MIDDLE[0]:g}" cy="{_MIDDLE[1]:g}" r="{1.06 * _REACH_PX:.1f}"/>'


def _views_of(plan: Plan, scale: float) -> Iterator[str]:
    """The views; what is compared with more sensors lies on top of what is compared with fewer."""
    parts = [(part, camera) for camera in plan.cameras for part in camera.parts]
    for part, camera in sorted(parts, key=lambda one: one[0].others):
        x, y = _at(camera, scale)
        shade, arc = min(part.others, _MOST_SHADES), _arc(camera, part.from_deg, part.to_deg, scale)
        yield f'<path class="view by{shade}" d="M{x:.1f} {y:.1f}{arc}Z"/>'
    for camera in plan.cameras:
        x, y = _at(camera, scale)
        arc = _arc(camera, camera.parts[0].from_deg, camera.parts[-1].to_deg, scale)
        yield f'<path class="edge" d="M{x:.1f} {y:.1f}{arc}Z"/>'


def _arc(camera: DrawnSensor, first_deg: float, last_deg: float, scale: float) -> str:
    steps = max(int(abs(last_deg - first_deg) / 3), 1)
    places = (_rim(camera, first_deg + (last_deg - first_deg) * n / steps, scale) for n in range(steps + 1))
    return "".join(f"L{x:.1f} {y:.1f}" for x, y in places)


def _pairs(plan: Plan, scale: float) -> Iterator[str]:
    """A line between each two LiDARs that are compared with each other."""
    for lidar, other in chain.from_iterable(combinations(lidars, 2) for lidars in plan.together):
        (x, y), (to_x, to_y) = _at(lidar, scale), _at(other, scale)
        yield f'<path class="pair" d="M{x:.1f} {y:.1f}L{to_x:.1f} {to_y:.1f}"/>'


def _lidar_labels(plan: Plan, scale: float) -> Iterator[str]:
    """Names of the LiDARs that are compared with each other, beside their dots; none on top of another."""
    below = -math.inf
    for lidar in sorted(chain.from_iterable(plan.together), key=lambda one: -one.ahead_m):
        x, y = _at(lidar, scale)
        below = max(y + 4, below + _LINE_PX)
        yield f'<text class="beside" x="{x + 12:.1f}" y="{below:.1f}">{_named(lidar.name)}</text>'


def _dot(sensor: DrawnSensor, scale: float, kind: str, radius: float) -> str:
    x, y = _at(sensor, scale)
    return (
        f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"><title>{_named(sensor.name)}</title></circle>'
    )


def _named(name: str) -> str:
    return _cut(one_line(name), _MOST_NAME)


def _labels(plan: Plan, scale: float) -> Iterator[str]:
    """Names of the cameras around the picture, beside where each looks; none on top of another."""
    taken: list[tuple[float, float, bool]] = []
    for camera in sorted(plan.cameras, key=lambda one: (abs(one.yaw_deg) > 90, abs(one.yaw_deg), one.left_m)):
        x, y = _rim(camera, camera.yaw_deg, scale)
        dx, dy = x - _MIDDLE[0], y - _MIDDLE[1]
        far = math.hypot(dx, dy) or 1.0
        label_x, label_y = _MIDDLE[0] + dx / far * _LABELS_PX, _MIDDLE[1] + dy / far * _LABELS_PX + 4
        while any(abs(label_y - other) < _LINE_PX and abs(label_x - at) < 150 for at, other, _ in taken):
            label_y += _LINE_PX if dy > 0 else -_LINE_PX
        side = dx / far
        anchor = "middle" if abs(side) < 0.2 else "start" if side > 0 else "end"
        taken.append((label_x, label_y, side > 0))
        yield f'<text x="{label_x:.1f}" y="{label_y:.1f}" text-anchor="{anchor}">{_named(camera.name)}</text>'


def _legend(plan: Plan) -> Iterator[str]:
    counts = {min(part.others, _MOST_SHADES) for camera in plan.cameras for part in camera.parts}
    words: Mapping[int, str] = {
        0: "compared with nothing",
        1: "with one other sensor, over time" if plan.alone else "with one other sensor",
        2: "with two",
        3: "with three or more",
    }
    x = 28.0
    for count in sorted(counts):
        word = words[count] if count != min(counts) or not count else f"compared {words[count]}"
        yield (
            f'<rect class="by{count}" x="{x:g}" y="{_LEGEND_Y}" width="22" height="13" rx="2" '
            'stroke="var(--rule)" stroke-width="0.8"/>'
        )
        yield f'<text class="small" x="{x + 28:g}" y="{_LEGEND_Y + 11}">{word}</text>'
        x += 44 + 6.4 * len(word)
    y = _LEGEND_Y + _ROW_PX * bool(counts)
    for lidars in plan.together:
        yield f'<path class="pair" d="M30 {y + 6.5:g}H48"/>'
        yield from (f'<circle class="lidar" cx="{cx}" cy="{y + 6.5:g}" r="5"/>' for cx in (30, 48))
        listed = ", ".join(one_line(one.name) for one in lidars)
        yield f'<text class="small" x="60" y="{y + 11}">compared with each other: {_cut(listed)}</text>'
        y += _ROW_PX
    for kind, radius, names in (("lidar", 6, plan.firsts), ("unused", 5, tuple(one.name for one in plan.unused))):
        if names:
            said = (
                f"LiDAR S_{LIDAR}{' of the cameras' if plan.cameras and plan.together else ''}"
                if kind == "lidar"
                else "LiDAR that is compared with nothing"
            )
            listed = ", ".join(map(one_line, names))
            yield f'<circle class="{kind}" cx="39" cy="{y + 6.5:g}" r="{radius}"/>'
            yield f'<text class="small" x="56" y="{y + 11}">{said}: {_cut(listed)}</text>'
            y += _ROW_PX
    if plan.said:
        names_of = ", ".join(one_line(name) for name in plan.said)
        yield f'<text class="small" x="56" y="{y + 11}">place not known: {_cut(names_of)}</text>'


def _cut(text: str, most: int = _MOST_LETTERS) -> str:
    return escape(text if len(text) <= most else text[: most - 1] + "…")

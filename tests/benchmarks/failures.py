"""Finds frames that are judged wrongly, or nearly so, and draws those of docs/failures.md.

Reads what `python -m tests.benchmarks.clean_statistics` measured; each scene is judged by thresholds learnt from the
scenes of other families. Streets are made and measured again to be drawn; recordings are listed, and never drawn:

    python -m tests.benchmarks.failures FOLDER [--cameras 1 2 3] [--r 0.01] [--first 20]
    python -m tests.benchmarks.failures FOLDER --into docs/failures [--only ghosts]
"""

import argparse
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import islice
from math import nan
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from auditor.identification.drive_level import for_clean_drive
from auditor.identification.prior import statistic_at
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import IMAGE_WINDOW, WindowMeans, vote, window_means_of
from auditor.identification.systems import System
from auditor.lab.evaluation.sources import Street
from auditor.measurement import use_one_thread
from auditor.measurement.checks.count_grid import CELL_PX
from auditor.measurement.frame import measure
from auditor.measurement.shared_view import FrameArrays
from auditor.model.arrays import Floats32, Image
from auditor.model.calibration import RobustThresholds
from auditor.model.checks import Check, CountedPair, SensorCheck, rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.measurement import LIGHT_STEPS, Measurement
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.clean_statistics import MATCHER, attacks_on, case_of
from tests.benchmarks.rates import Judged, clean_frames, judge_all, judge_scene, system_of, thresholds_of
from tests.benchmarks.scenes import Case, Scene, load

CAMERAS = (1, 2, 3, 4)
RATE = Decimal("0.01")
MOST_BYTES = 60_000
WIDTH, HEIGHT = 480, 145
_FULL_RESIDUAL = 0.5
_OUTLINED_LEVELS = 20
_BLACK, _WHITE, _GREY, _YELLOW = (0, 0, 0), (255, 255, 255), (150, 150, 150), (0, 230, 255)
_RED, _GREEN = (60, 60, 255), (60, 180, 60)


class Picture(NamedTuple):
    """One case of a street: a clean frame, or an attack on some sensors. `sensor` is the one whose maps are drawn.

    The street was measured with `frames` frames of KITTI's size times `scale`, of which the first was attacked as well.
    """

    name: str
    seed: int
    frame: int
    sensor: int
    attack: str = ""
    attacked: tuple[int, ...] = ()
    cameras: tuple[int, ...] = CAMERAS
    frames: int = 8
    scale: float = 1.0


THREE = (1, 2, 3)
PICTURES = (
    Picture("car-at-the-edge", 7093, 3, 1),
    Picture("low-sun", 7099, 6, 1),
    Picture("behind-a-trunk", 7087, 3, 3, cameras=THREE),
    Picture("sky-beside-a-post", 7037, 2, 2),
    Picture("car-without-returns", 7043, 7, 0),
    Picture("facula-in-the-sky", 7012, 0, 4, "R 75 mild", (4,)),
    Picture("facula-in-a-white-sky", 7041, 0, 4, "paper's facula", (4,)),
    Picture("facula-beside-white-leaves", 7095, 0, 2, "paper's facula", (2,)),
    Picture("two-faculas", 7005, 0, 2, "two faculas", (2, 4)),
    Picture("wall-in-the-dark", 7027, 0, 0, "wall 1 m", (0,)),
    Picture("turquoise-wall", 10883, 56, 2, cameras=THREE, frames=100, scale=0.5),
    Picture("glare-on-a-car", 11330, 58, 2, frames=100, scale=0.5),
    Picture("dark-wall", 11172, 1, 2, cameras=THREE, frames=100, scale=0.5),
)


@dataclass(frozen=True, eq=False)
class Shown:
    """A case that was made again: its frame, and the same without the attack, what was measured, and the verdict."""

    picture: Picture
    scene: Scene
    rig: Rig
    frame: Frame
    clean: Frame
    measurement: Measurement
    arrays: FrameArrays
    verdict: Verdict
    limit: float
    z: Mapping[SensorCheck, float]
    statistics: Mapping[SensorCheck, float]
    at_limit: Mapping[SensorCheck, float]

    def strongest(self, sensor: int) -> SensorCheck:
        """The check of a sensor with the largest z."""
        return max((one for one in self.z if one.sensor == sensor), key=lambda one: np.nan_to_num(self.z[one], nan=-9))


def frames_of(picture: Picture) -> tuple[Rig, Frame, Frame]:
    """The rig of the street, the frame with the attack and without it."""
    street = Street(picture.seed, picture.frames, len(CAMERAS), picture.scale)
    with street.open(colour=True) as (drive,):
        frame = next(islice((one for one in drive.frames if isinstance(one, Frame)), picture.frame, None))
        if not picture.attack:
            return drive.rig, frame, frame
        rng = np.random.default_rng(zlib.crc32(f"street {picture.seed}".encode()))
        attacks = attacks_on(frame, drive.rig, rng)
        (changed,) = (one for name, on, one in attacks if (name, on) == (picture.attack, picture.attacked))
        return drive.rig, changed, frame


def show(picture: Picture, scenes: Sequence[Scene]) -> Shown:
    """Make and measure a case again, and judge it by the scenes of other families."""
    (scene,) = (one for one in scenes if one.name == f"street {picture.seed}")
    rig, frame, clean = frames_of(picture)
    measurement, arrays = measure(frame, rig, MATCHER)
    case = case_of(measurement, rig, picture.attack, picture.attacked)
    system = system_of(scene, picture.cameras)
    learnt = [clean_frames(one, system_of(one, picture.cameras)) for one in scenes if one.family != scene.family]
    thresholds, _ = thresholds_of(learnt, system, RATE)
    judged = judge_scene(_with(scene, case), system, thresholds, None)
    thresholds = for_clean_drive(thresholds, system.sensor_checks, clean_frames(scene, system))
    z, statistics = _scores(case, rig, system, thresholds)
    (verdict,) = (one.robust for one in judged if (one.case.attack, one.case.frame) == (case.attack, case.frame))
    limit = thresholds.limit
    at_limit = {one: statistic_at(found.mean + limit * found.deviation) for one, found in thresholds.expected.items()}
    return Shown(picture, scene, rig, frame, clean, measurement, arrays, verdict, limit, z, statistics, at_limit)


def told(shown: Shown) -> str:
    """The verdict, and of each sensor the strongest check: z, the statistic and what it is at the limit."""
    scores = (
        f"S_{one.sensor} {one.check.value} {z:.2f} ({shown.statistics[one]:.2f} of {shown.at_limit[one]:.2f})"
        for one in (shown.strongest(sensor) for sensor in (LIDAR, *shown.picture.cameras))
        for z in [shown.z[one]]
    )
    named = " ".join(f"S_{sensor}" for sensor in shown.verdict.attacked)
    return f"{shown.picture.name}: {shown.verdict.kind.value} {named}, limit {shown.limit:.2f}; {', '.join(scores)}"


def _with(scene: Scene, case: Case) -> Scene:
    """The clean frames of a scene and this case; a clean one takes the place of what was measured before."""
    clean = [one for one in scene.cases if not one.attack]
    if case.attack:
        return replace(scene, cases=(*clean, case))
    features = {one.frame: one.features for one in clean}[case.frame]
    new = replace(case, features=features)
    return replace(scene, cases=tuple(new if one.frame == case.frame else one for one in clean))


def _scores(
    case: Case, rig: Rig, system: System, thresholds: RobustThresholds
) -> tuple[dict[SensorCheck, float], dict[SensorCheck, float]]:
    """z and statistic of the checks that count where no sensor is missing."""
    place = {check: column for column, check in enumerate(rig_sensor_checks(rig))}
    checks = [system.sensor_checks[column] for column in system.counting(frozenset())]
    values = np.array([[case.statistics[place[check]] for check in checks]])
    z = normalised_scores(values, [thresholds.expected.get(check) for check in checks])
    return dict(zip(checks, z[0].tolist(), strict=True)), dict(zip(checks, values[0].tolist(), strict=True))


def draw(shown: Shown) -> Image:
    """All cameras, then what the voters say of the sensor, then z of each sensor beside the limit."""
    sensor = shown.picture.sensor
    panels = [_camera(shown, number) for number in shown.picture.cameras]
    panels += _points(shown) if sensor == LIDAR else _voters(shown, sensor)
    panels.append(_bars(shown))
    if len(panels) % 2:
        panels.append(np.zeros_like(panels[0]))
    rows = [np.hstack(panels[at : at + 2]) for at in range(0, len(panels), 2)]
    return np.vstack(rows)


def _camera(shown: Shown, number: int) -> Image:
    pixels = shown.frame.images[number].pixels
    panel = _panel(pixels)
    before, after = (_panel(one.images[number].pixels).astype(np.int16) for one in (shown.clean, shown.frame))
    changed = (np.abs(after - before).max(axis=2) >= _OUTLINED_LEVELS).astype(np.uint8)
    outlines, _ = cv2.findContours(changed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(panel, outlines, -1, _YELLOW, 1)
    if LIDAR in shown.picture.attacked and number in shown.arrays.lidar:
        _draw_invented(panel, shown, number)
    return _named(panel, f"S_{number} {'colour' if pixels.ndim > 2 else 'grey'}")


def _draw_invented(panel: Image, shown: Shown, number: int) -> None:
    """The points that an attack moved or added."""
    assert shown.frame.cloud is not None
    assert shown.clean.cloud is not None
    assert shown.rig.lidar is not None
    before, after = shown.clean.cloud.xyz_m, shown.frame.cloud.xyz_m
    moved = np.ones(len(after), dtype=np.bool_)
    moved[: len(before)] = (after[: len(before)] != before).any(axis=1)
    camera = shown.rig.camera(number)
    projection = camera.projection @ shown.rig.lidar.rig_SE3_lidar
    u, v, w = projection @ np.vstack([after[moved].T, np.ones(moved.sum())])
    for x, y in zip(u / w * WIDTH / camera.width_px, v / w * HEIGHT / camera.height_px, strict=True):
        cv2.circle(panel, (round(x), round(y)), 1, _YELLOW, -1)


def _voters(shown: Shown, camera: int) -> list[Image]:
    """What each voter says of a camera, in the camera's own image, and the window in which the strongest check is."""
    strongest = shown.strongest(camera)
    box = _window(shown, strongest)
    panels = []
    for other in strongest.others:
        panel = _compared(shown, camera, other)
        if box is not None:
            cv2.rectangle(panel, *box, _BLACK, 3)
            cv2.rectangle(panel, *box, _WHITE, 1)
        panels.append(_named(panel, f"S_{camera} as S_{other} predicts it"))
    return panels


def _compared(shown: Shown, camera: int, other: int) -> Image:
    """The camera's image, dark: red where brighter than predicted, blue where darker, green where inconsistent."""
    i, k = sorted((camera, other))
    light = shown.measurement.cells[CountedPair(Check.ADDED_LIGHT, i, k, camera)]
    differs = shown.measurement.cells[CountedPair(Check.PHOTOMETRIC_INCONSISTENCY, i, k, camera)]
    residual = light.total / np.maximum(light.valid, 1) / LIGHT_STEPS / _FULL_RESIDUAL
    share = differs.total / np.maximum(differs.valid, 1)
    image = shown.frame.images[camera].pixels
    dark = cv2.cvtColor(_panel(image), cv2.COLOR_BGR2GRAY).astype(np.float32)
    dark *= _spread(np.where(light.valid > 0, 0.5, 0.15).astype(np.float32), image)
    tints = [
        _spread(np.clip(one, 0, 1).astype(np.float32), image) * 255 for one in (-residual, share, residual)
    ]  # blue, green, red
    return np.clip(np.stack([dark + tint for tint in tints], axis=2), 0, 255).astype(np.uint8)


def _spread(cells: Floats32, image: Image) -> Floats32:
    """(HEIGHT, WIDTH): cells at the places of their pixels in a panel of the image."""
    whole = cells.repeat(CELL_PX, axis=0).repeat(CELL_PX, axis=1)[: image.shape[0], : image.shape[1]]
    return np.asarray(cv2.resize(whole, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), dtype=np.float32)


def _window(shown: Shown, strongest: SensorCheck) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """The corners, in a panel, of the window in which the voters together say most."""
    grid = Check.PHOTOMETRIC_INCONSISTENCY if strongest.check is Check.PHOTOMETRIC_INCONSISTENCY else Check.ADDED_LIGHT
    pairs = [(*sorted((strongest.sensor, other)), strongest.sensor) for other in strongest.others]
    voters = window_means_of([CountedPair(grid, *pair) for pair in pairs], shown.measurement.cells)
    voters = voters.opposite if strongest.check is Check.REMOVED_LIGHT else voters
    said = np.array(
        [
            [vote(strongest.check, _at(voters, row, column)) or nan for column in range(voters.means.shape[2])]
            for row in range(voters.means.shape[1])
        ]
    )
    if np.isnan(said).all():
        return None
    row, column = np.unravel_index(int(np.nanargmax(said)), said.shape)
    camera = shown.rig.camera(strongest.sensor)
    x, y = CELL_PX * WIDTH / camera.width_px, CELL_PX * HEIGHT / camera.height_px
    end = column + IMAGE_WINDOW.columns, row + IMAGE_WINDOW.rows
    return (round(column * x), round(row * y)), (round(end[0] * x), round(end[1] * y))


def _at(voters: WindowMeans, row: int, column: int) -> WindowMeans:
    """What the voters say of one window."""
    one = np.s_[:, row : row + 1, column : column + 1]
    return WindowMeans(voters.means[one], voters.known[one])


def _points(shown: Shown) -> list[Image]:
    """The LiDAR's points that each pair can judge: green where the cameras agree with them, red where not."""
    panels = []
    for (i, k), found in shown.arrays.frame_checks.verified_conflicts.items():
        if not {i, k} <= set(shown.picture.cameras):
            continue
        camera = shown.rig.camera(k)
        panel = np.asarray(_panel(shown.frame.images[k].pixels) * 0.4, dtype=np.uint8)
        x, y = found.column * WIDTH // camera.width_px, found.row * HEIGHT // camera.height_px
        for mask, colour, size in ((found.valid, _GREEN, 0), (found.lidar_conflicts, _RED, 1)):
            for place in zip(x[mask].tolist(), y[mask].tolist(), strict=True):
                cv2.circle(panel, place, size, colour, -1)
        panels.append(_named(panel, f"LiDAR points judged by S_{i} and S_{k}"))
    return panels[:3]


def _bars(shown: Shown) -> Image:
    panel: Image = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    left, step = 250, 34.0
    sensors = [LIDAR, *shown.picture.cameras]
    for row, sensor in enumerate(sensors):
        check = shown.strongest(sensor)
        z = shown.z[check]
        y = 12 + row * 22
        end = left + round(step * float(np.clip(z, 0, 6.4)))
        cv2.rectangle(panel, (left, y), (end, y + 12), _RED if z > shown.limit else _GREY, -1)
        text = f"S_{sensor} {check.check.value.replace('_', ' ')}: z {z:.2f}"
        _write(panel, text, (4, y + 11), _YELLOW if sensor in shown.picture.attacked else _WHITE)
    at = left + round(step * shown.limit)
    cv2.line(panel, (at, 4), (at, HEIGHT - 20), _WHITE, 1)
    named = ", ".join(f"S_{sensor}" for sensor in shown.verdict.attacked)
    _write(panel, f"limit {shown.limit:.2f}", (at - 30, HEIGHT - 6), _WHITE)
    _write(panel, f"verdict: {shown.verdict.kind.value} {named}", (4, HEIGHT - 6), _WHITE)
    return panel


def _panel(pixels: Image) -> Image:
    colours = pixels if pixels.ndim > 2 else cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR)
    return np.asarray(cv2.resize(colours, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _named(panel: Image, text: str) -> Image:
    _write(panel, text, (5, 14), _WHITE)
    return panel


def _write(panel: Image, text: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 1)
    x, y = place
    cv2.rectangle(panel, (x - 2, y - height - 2), (x + width + 2, y + below), (0, 0, 0), -1)
    cv2.putText(panel, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, 1, cv2.LINE_AA)


def jpeg(image: Image) -> bytes:
    """As good as fits into MOST_BYTES."""
    for quality in range(85, 20, -5):
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) < MOST_BYTES:
            break
    return data


def described(one: Judged) -> str:
    """A case in one line."""
    verdict, case = one.robust, one.case
    named = "".join(f" S_{sensor}" for sensor in verdict.attacked)
    evidence = ", ".join(f"{e.check_name} of S_{e.i} {e.score:.2f}" for e in verdict.evidence[:3])
    on = " ".join(f"S_{sensor}" for sensor in case.attacked)
    what = f"{case.attack} on {on}" if case.attack else "clean"
    where = f"{one.scene.name} ({one.scene.family}, cameras {one.scene.kinds}) frame {case.frame}"
    return f"{where}, {what}: {verdict.kind.value}{named}, gap {verdict.gap or 0:.2f}" + (evidence and f"; {evidence}")


def worst(judged: Iterable[Judged], first: int) -> Iterable[str]:
    """The clean frames that are raised or come nearest to the limit, then the attacks that are not named exactly."""

    def nearness(one: Judged) -> float:
        gap = one.robust.gap or 0.0
        return gap if one.robust.kind is VerdictKind.CLEAN else -1 - gap

    cases = list(judged)
    yield from map(described, sorted((one for one in cases if not one.case.attack), key=nearness)[:first])
    wrong = [one for one in cases if one.case.attack and one.robust.attacked != one.case.attacked]
    for attack in dict.fromkeys(one.case.attack for one in wrong):
        of_attack = [one for one in wrong if one.case.attack == attack]
        yield f"{attack}: {len(of_attack)} not named exactly, among them"
        yield from (f"  {described(one)}" for one in of_attack[:first])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--r", type=Decimal, default=RATE)
    parser.add_argument("--cameras", type=int, nargs="+", default=list(CAMERAS))
    parser.add_argument("--first", type=int, default=20, help="how many of each kind are listed")
    parser.add_argument("--into", type=Path, help="where the pictures of the folder's streets are written")
    parser.add_argument("--only", nargs="+", default=[one.name for one in PICTURES], help="names of pictures")
    options = parser.parse_args()
    use_one_thread()
    scenes = load(options.folder)
    if options.into is None:
        print("\n".join(worst(judge_all(scenes, options.cameras, options.r), options.first)))
        return
    options.into.mkdir(parents=True, exist_ok=True)
    there = {scene.name for scene in scenes}
    for picture in PICTURES:
        if picture.name in options.only and f"street {picture.seed}" in there:
            shown = show(picture, scenes)
            (options.into / f"{picture.name}.jpg").write_bytes(jpeg(draw(shown)))
            print(told(shown), flush=True)


if __name__ == "__main__":
    main()

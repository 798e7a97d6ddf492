"""Trains the detectors that come with auditor, and scores them.

    python -m tests.benchmarks.street_detectors train --out FOLDER
    python -m tests.benchmarks.street_detectors score
    python -m tests.benchmarks.street_detectors walls [RECORDING]
    python -m tests.benchmarks.street_detectors baseline [RECORDING...] [--known] --out STORE

`train` renders streets and writes images_fp16.safetensors and clouds_fp16.safetensors, with their hashes. `score` has
average precision of cars by family, of streets that were never trained on, some of other styles and conditions.
`walls` puts the paper's bogus wall into clean clouds and counts those in which it is found as a car that was not there
(the paper's PIXOR: 986 of 1,000). `baseline` is the object-level baseline and average precision under attack alone,
without the method's own tables, which `auditor evaluate` has too: on streets, every second frame attacked, with
`--known` on those of families trained on, or on recordings.
"""

import argparse
import hashlib
import time
from collections import Counter
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from auditor.lab.attacks.paper import draw_wall
from auditor.lab.evaluation.experiments import WALL_WIDTHS_M
from auditor.lab.evaluation.object_baseline import ObjectTask, evaluate_objects
from auditor.lab.evaluation.object_baseline.agreement import in_view
from auditor.lab.evaluation.object_baseline.average_precision import ScoredObjects, score_in_image, score_on_ground
from auditor.lab.evaluation.object_baseline.detectors import CAR, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.streets import clouds, images
from auditor.lab.evaluation.object_baseline.detectors.streets.network import packed
from auditor.lab.evaluation.object_baseline.runner import street_labels
from auditor.lab.evaluation.sources import RecordingSource, Source, Street
from auditor.model.frames import Frame
from auditor.store.queries import run_query
from auditor.store.store import Store
from tests.making.street_detectors import (
    CLOUDS,
    IMAGES,
    Training,
    families_trained_on,
    street_frames,
    trained,
    training_streets,
)

STEPS = {"clouds": 900, "images": 1500}
"""Of the weights that come with auditor, as are the numbers of streets and frames below."""

STREETS, FRAMES = 120, 6
RECALLS = 40
SURE = 0.5
NEAR_M = 3.0


def train(out: Path, streets: int, frames: int) -> None:
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(mode=True)
    started = time.process_time()
    made = [frame for street in training_streets(streets) for frame in street_frames(street, frames)]
    print(f"{len(made)} frames of {streets} streets: {time.process_time() - started:.0f} CPU s", flush=True)
    out.mkdir(parents=True, exist_ok=True)
    for name, count in STEPS.items():
        started, losses = time.process_time(), []
        kind, how = {"images": IMAGES, "clouds": CLOUDS}[name], Training(count)
        for step, loss, now in trained(kind, made, how):
            losses.append(loss)
            network = now
            if step % 50 == 0:
                spent = time.process_time() - started
                print(f"{name}: step {step}, loss {np.mean(losses[-50:]):.3f}, {spent:.0f} CPU s", flush=True)
        content = packed(network)
        (out / f"{name}_fp16.safetensors").write_bytes(content)
        numbers = sum(values.numel() for values in network.parameters())
        print(f"{name}: {numbers} parameters, {len(content)} bytes, sha256 {hashlib.sha256(content).hexdigest()}")


def average_precision(frames: list[ScoredObjects]) -> float:
    """Mean of the best precision at each recall or a higher one."""
    truths = sum(one.truths for one in frames)
    found = sorted(
        ((s, h) for one in frames for s, h in zip(one.scores, one.hits, strict=True)), key=lambda one: -one[0]
    )
    hits = np.cumsum([hit for _, hit in found])
    precision = hits / np.arange(1, len(found) + 1)
    at = [precision[hits >= share * truths] for share in np.arange(1, RECALLS + 1) / RECALLS]
    return float(np.mean([of_it.max(initial=0.0) for of_it in at]))


def score(first: int, streets: int, frames: int) -> None:
    torch.set_num_threads(1)
    of_images, of_clouds = images.shipped_images(), clouds.shipped_clouds()
    by_family: dict[str, list[tuple[ScoredObjects, ScoredObjects]]] = {}
    for street in (Street(seed, 50) for seed in range(first, first + streets)):
        with street.open() as (drive,):
            rig, lidar, truth = drive.rig, drive.rig.lidar, drive.street
            assert lidar is not None
            assert truth is not None
            for number in np.linspace(0, street.frames - 1, frames).astype(int).tolist():
                labels = street_labels(truth, number, rig.n)
                in_image = of_images.detect(truth.image(number, rig.n).pixels)
                in_cloud = of_clouds.detect(truth.cloud(number).xyz_m, lidar.rig_SE3_lidar)
                view = rig.camera(rig.n)
                pair = (
                    *score_in_image(rig.n, in_image, labels, frozenset([CAR])),
                    *score_on_ground(0, in_cloud, labels, frozenset([CAR]), lambda box, view=view: in_view(box, view)),
                )
                kind = "families trained on" if families_trained_on(street) else "other families"
                for name in (kind, street.family):
                    by_family.setdefault(name, []).append(pair)
    for name in sorted(by_family, key=lambda name: (len(by_family[name]) < frames * 3, name)):
        one = by_family[name]
        cars = sum(pair[0].truths for pair in one)
        precisions = (average_precision([pair[at] for pair in one]) for at in (0, 1))
        print(f"{name:28} {len(one):4} frames {cars:4} cars  AP " + "  ".join(f"{of_it:.3f}" for of_it in precisions))


def walls(sources: list[Source]) -> None:
    torch.set_num_threads(1)
    detector = clouds.shipped_clouds()
    for width in (None, *WALL_WIDTHS_M):
        cases = raised = 0
        for source in sources:
            with source.open() as drives:
                for frame in drives[0].frames:
                    lidar = drives[0].rig.lidar
                    if not isinstance(frame, Frame) or frame.cloud is None or lidar is None:
                        continue
                    drawn = draw_wall(np.random.default_rng([frame.number, frame.stamp_ns % 2**32]))
                    wall = drawn if width is None else replace(drawn, width_m=width)
                    at = lidar.rig_SE3_lidar[:3, 3] + [wall.lateral_m, 0, wall.range_m]
                    sure = [
                        max(
                            (one.score for one in detector.detect(cloud.xyz_m, lidar.rig_SE3_lidar) if near(one, at)),
                            default=0,
                        )
                        for cloud in (frame.cloud, wall.apply(frame.cloud, drives[0].rig))
                    ]
                    cases += sure[0] < SURE
                    raised += sure[0] < SURE <= sure[1]
        print(f"wall of {width or 'the usual'} width: found as a car in {raised} of {cases} frames", flush=True)


def near(one: SolidDetection, at: np.ndarray) -> bool:
    """A car whose rear the wall is has its middle up to half a length behind it."""
    return bool(np.hypot(one.box.x_m - at[0], one.box.z_m - at[2]) < NEAR_M)


def baseline(sources: list[Source], out: Path) -> None:
    for source in sources:
        every = 2 if isinstance(source, Street) else 1
        evaluate_objects(ObjectTask(source, out, detectors=("streets",), attack_every=every), lambda *_: None)
    store = Store.open(out)
    pooled: dict[tuple[object, ...], Counter[str]] = {}
    for row in run_query(store, "evaluation_objects", {"r": "0.01,0.05"}).to_pylist():
        if row["attacked"] is None:
            key = tuple(str(row[name]) for name in ("left_out", "r", "scenario", "iou", "strength"))
            counts = {name: row[name] for name in ("detected", "cases", "raised", "frames")}
            pooled.setdefault(key, Counter()).update(counts)
    for key, sums in sorted(pooled.items()):
        rates = sums["detected"] / sums["cases"], sums["raised"] / sums["frames"]
        print(*key, f"{rates[0]:.3f} of {sums['cases']}, clean {rates[1]:.3f} of {sums['frames']}")
    for row in run_query(store, "evaluation_average_precision", {}).to_pylist():
        print(
            *(row[name] for name in ("sensor", "strength", "size", "cases", "truths")),
            f"{row['average_precision']:.3f}",
        )


def evaluated_streets(first: int, count: int, frames: int, *, known: bool) -> list[Source]:
    """The first so many streets, with `known` of the families that are trained on."""
    streets = (Street(seed, frames) for seed in range(first, first + 10 * count))
    return list(islice((one for one in streets if not known or families_trained_on(one)), count))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["train", "score", "walls", "baseline"])
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--known", action="store_true", help="streets of families that are trained on")
    parser.add_argument("--out", type=Path, default=Path("detectors"))
    parser.add_argument("--streets", type=int)
    parser.add_argument("--frames", type=int)
    parser.add_argument("--first", type=int, default=1000, help="the first street that is scored")
    given = parser.parse_args()
    recorded: list[Source] = [RecordingSource(path) for path in given.recordings]
    if given.what == "train":
        train(given.out, given.streets or STREETS, given.frames or FRAMES)
    elif given.what == "score":
        score(given.first, given.streets or 36, given.frames or 4)
    elif given.what == "walls":
        walls(recorded or evaluated_streets(given.first, given.streets or 36, given.frames or 4, known=given.known))
    else:
        streets = evaluated_streets(given.first, given.streets or 36, given.frames or 6, known=given.known)
        baseline(recorded or streets, given.out)


if __name__ == "__main__":
    main()

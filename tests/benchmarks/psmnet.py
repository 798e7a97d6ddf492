"""The cost of PSMNet: `python -m tests.benchmarks.psmnet [--weights FILE --align-corners] [--device cuda]`.

On the CPU: seconds and peak memory of one pair at 1248 x 384 with 192 disparities, here and in the naive form (the
published network as it is written down, called once a pair), and the prediction of `frame_cost`. With --device cuda:
frames a second with three cameras (two pairs), naive and here, for each precision and number of frames at once,
compiled or not, and how far each precision's disparities are from fp32's; then a whole recording: decoded, matched and
compared, frame by frame with the naive form and as a scan does it (--recording: that alone, a short one on the CPU).
Without --weights the weights are drawn by a rule from their names: times stay the same, but what a precision does to
disparities should be judged with trained ones. With AUDITOR_TEST_DATA set the images are real. With --train: a toy
network learns two planes of known disparity.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from time import perf_counter

import cv2
import numpy as np
import torch

from auditor.lab.simulation.drives import make_drive
from auditor.lab.training.checkpoints import TrainingSettings
from auditor.lab.training.psmnet import train
from auditor.lab.training.samples import Sample, score
from auditor.measurement import measure, measure_stream
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.matchers.psmnet import (
    PsmnetMatcher,
    Weights,
    check_precision,
    frame_cost,
    load_weights,
)
from auditor.measurement.disparity.matchers.psmnet.inference import PRECISIONS, InferenceEngine
from auditor.measurement.disparity.matchers.psmnet.network import PSMNet
from auditor.measurement.disparity.matchers.psmnet.weights import content_sha256
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, survey, synchronise, write_mcap
from tests.making.psmnet_networks import noise, ruled_state

HEIGHT, WIDTH, RANGE_PX = 375, 1242, 192
WHOLE_FRAMES = 60
CAMERAS = (2, 3, 1)  # left to right: the reference, then its source cameras
PAIRS = [(0, 1), (0, 2)]
FRAMES_AT_ONCE = (1, 2, 4, 8)
ROUNDS = 5
PIXELS_MB = 1e6


def images() -> list[np.ndarray]:
    """One frame of three cameras, the reference first."""
    data = os.environ.get("AUDITOR_TEST_DATA")
    if not data:
        return [noise(HEIGHT, WIDTH, seed) for seed in range(3)]
    drive = Path(data) / "kitti_raw_2011_09_26_drive_0009" / "2011_09_26" / "2011_09_26_drive_0009_sync"
    paths = [sorted((drive / f"image_{camera:02}" / "data").iterdir())[0] for camera in CAMERAS]
    return [cv2.imread(str(path), cv2.IMREAD_COLOR)[:HEIGHT, :WIDTH] for path in paths]


class Naive:
    """The network as it is written down: two feature passes a pair, batch normalisation apart, nothing batched."""

    name, settings, step, colour, range_px = "naive", "", 1, True, RANGE_PX

    def __init__(self, weights: Weights, align_corners: bool, device: str) -> None:
        self.network = PSMNet(max_disparity=RANGE_PX, align_corners=align_corners, width=weights.width)
        self.network.load_state_dict(weights.state)
        self.network.eval().to(device)
        self.engine = InferenceEngine(self.network, torch.device(device))

    @torch.inference_mode()
    def match(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        tensors = [self.engine.load([image]).contiguous() for image in (left, right)]
        features = [self.network.feature_extraction(tensor) for tensor in tensors]
        cost = self.network.costs(self.network.volume(*features))[2]
        size = (tensors[0].shape[-2], tensors[0].shape[-1])
        disparity = self.network.disparity(cost, size)[0].cpu().numpy()
        return disparity[size[0] - left.shape[0] :, : left.shape[1]]


def seconds(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Median of a few rounds after one that is not counted."""
    times = []
    for _ in range(rounds + 1):
        started = perf_counter()
        work()  # ends with the disparities on the CPU, so a GPU has finished
        times.append(perf_counter() - started)
    return median(times[1:])


def on_cpu(weights: Weights, align_corners: bool, form: str) -> None:
    """One pair, one thread, in this process: memory is the process's own peak."""
    torch.set_num_threads(1)
    left, right = images()[:2]
    matcher = PsmnetMatcher(weights, align_corners=align_corners, max_disparity=RANGE_PX)
    predicted_s = frame_cost(matcher, (HEIGHT, WIDTH)).frame_s(images=2, pairs=1) if form == "here" else None
    match = matcher.match if form == "here" else Naive(weights, align_corners, "cpu").match
    before = resource.getrusage(resource.RUSAGE_SELF)
    started = perf_counter()
    match(left, right)
    wall = perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_SELF)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    prediction = f", predicted {predicted_s:.1f} s" if predicted_s else ""
    print(f"{form:6} {cpu:6.1f} s CPU, {wall:6.1f} s wall{prediction}, peak {after.ru_maxrss / PIXELS_MB:.2f} GB")


def on_gpu(weights: Weights, align_corners: bool, device: str) -> None:
    """Frames a second of three cameras, with the memory and the precision of each way."""
    frame = images()
    naive = Naive(weights, align_corners, device)
    torch.cuda.reset_peak_memory_stats()
    slow = seconds(lambda: [naive.match(frame[left], frame[right]) for left, right in PAIRS])
    print(f"{torch.cuda.get_device_name()}, torch {torch.__version__}")
    print(f"naive                      {1 / slow:7.2f} frames/s   {torch.cuda.max_memory_allocated() / 1e9:6.2f} GB")
    for precision in PRECISIONS:
        for compiled in (False, True):
            matcher = PsmnetMatcher(
                weights,
                align_corners=align_corners,
                max_disparity=RANGE_PX,
                device=device,
                precision=precision,
                compiled=compiled,
            )
            check = check_precision(matcher, frame, PAIRS)
            for count in FRAMES_AT_ONCE:
                pairs = [(3 * n + left, 3 * n + right) for n in range(count) for left, right in PAIRS]
                torch.cuda.reset_peak_memory_stats()
                fast = (
                    seconds(lambda matcher=matcher, pairs=pairs, n=count: matcher.match_pairs(frame * n, pairs)) / count
                )
                print(
                    f"{precision} {'compiled' if compiled else '        '} {count} at once {1 / fast:7.2f} frames/s   "
                    f"{torch.cuda.max_memory_allocated() / 1e9:6.2f} GB   {slow / fast:5.2f} times naive   "
                    f"|d - fp32| mean {check.mean_px:.4f}, largest {check.largest_px:.3f} px"
                )


def whole_recording(weights: Weights, align_corners: bool, device: str) -> None:
    """A recording of three cameras from its files to counts: what a scan takes, and what the naive form would."""
    count = WHOLE_FRAMES if device != "cpu" else 2
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.mcap"
        drive = make_drive(1, count, n_cameras=3, width_px=WIDTH, height_px=HEIGHT)
        write_mcap(path, drive.rig, drive.frames())
        naive = Naive(weights, align_corners, device)
        slow = recording_seconds(
            path, lambda frames, rig: [measure(f, rig, naive) for f in frames if isinstance(f, Frame)]
        )
        print(f"whole recording, naive     {count / slow:7.2f} frames/s")
        for precision, compiled in (
            (("fp32", False), ("fp16", False), ("fp16", True)) if device != "cpu" else (("fp32", False),)
        ):
            matcher = PsmnetMatcher(
                weights,
                align_corners=align_corners,
                max_disparity=RANGE_PX,
                device=device,
                precision=precision,
                compiled=compiled,
            )
            matcher.match_pairs(images(), PAIRS)  # what setting up costs is not counted
            fast = recording_seconds(path, lambda frames, rig, m=matcher: list(measure_stream(frames, rig, m)))
            form = f"{precision} {'compiled' if compiled else ''}"
            print(f"whole recording, {form:13} {count / fast:7.2f} frames/s   {slow / fast:5.2f} times naive")


def recording_seconds(path: Path, work: Callable[[Iterable[Frame | SkippedFrame], Rig], object]) -> float:
    """Seconds to read, match and compare all frames of a recording."""
    with open_recording(path) as recording:
        surveyed = survey(recording)
        rig = find_rigs(surveyed)[0]
        started = perf_counter()
        work(synchronise(recording, rig, surveyed, colour=True), rig)
        return perf_counter() - started


def planes(seed: int, height: int = 64, width: int = 96) -> Sample:
    """Noise on two planes, one above the other, 2 to 13 and 14 to 25 px; every second truth is missing."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.integers(0, 256, (height, width + 40, 3)).astype(np.uint8), (0, 0), 1.0)
    edge, far, near = rng.integers(height), rng.integers(2, 14), rng.integers(14, 26)
    disparity = np.where(np.arange(height)[:, None] < edge, far, near).repeat(width, axis=1)
    right = texture[np.arange(height)[:, None], np.arange(width) + disparity]
    truth = np.where(rng.random(disparity.shape) < 0.5, np.nan, disparity).astype(np.float32)
    return texture[:, :width], right, truth


def training() -> None:
    """Print the curve of a toy network on unseen planes, and what SGBM gives on the same pixels."""
    torch.set_num_threads(1)
    settings = TrainingSettings(
        max_disparity=32, width=8, crop=(48, 64), batch=2, steps=400, validate_every=50, learning_rate=2e-3
    )
    unseen = {"planes": [planes(1000 + seed) for seed in range(8)]}
    started = perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        for row in train([planes(seed) for seed in range(64)], unseen, settings, Path(folder)):
            scores = row.validation["planes"]
            print(f"step {row.step:4} loss {row.loss:6.3f} {scores} after {perf_counter() - started:.0f} s")
    print(f"sgbm-full {score(SgbmMatcher(step=1), unseen['planes'])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--align-corners", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--form", choices=["here", "naive"], help="CPU: one form alone, in this process")
    parser.add_argument("--train", action="store_true", help="train a toy network")
    parser.add_argument("--recording", action="store_true", help="a whole recording alone, on the CPU a short one")
    arguments = parser.parse_args()
    if arguments.train:
        training()
        return
    if arguments.device == "cpu" and arguments.form is None and not arguments.recording:
        for form in ("naive", "here"):  # a process each: peak memory never falls
            subprocess.run([sys.executable, "-m", "tests.benchmarks.psmnet", *sys.argv[1:], "--form", form], check=True)
        return
    if arguments.weights:
        weights = load_weights(arguments.weights)
    else:
        state = ruled_state()
        weights = Weights(state, 32, content_sha256(state), None, None, "the rule")
    if arguments.recording:
        whole_recording(weights, arguments.align_corners, arguments.device)
    elif arguments.device == "cpu":
        on_cpu(weights, arguments.align_corners, arguments.form)
    else:
        on_gpu(weights, arguments.align_corners, arguments.device)
        whole_recording(weights, arguments.align_corners, arguments.device)


if __name__ == "__main__":
    main()

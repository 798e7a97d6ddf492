"""One frame under many attacks: only what an attack changes is measured again."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Protocol, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from auditor.identification.statistics import windowed_ratios
from auditor.measurement.checks.collect import FrameChecks, collect_checks
from auditor.measurement.checks.disparity_error import compare_cameras, compare_with_lidar
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.disparity.matchers import Matcher
from auditor.measurement.disparity.matchers.interface import PairMatcher
from auditor.measurement.disparity.rectification import PairView, Rectification, rectification
from auditor.measurement.disparity.stereo import StereoMap, stereo_map, stereo_maps, textured, within
from auditor.measurement.fault_features.collect import FeatureInputs, fault_features_of, feature_inputs
from auditor.measurement.fault_features.frozen_data import fingerprint_of_image, fingerprint_of_points
from auditor.measurement.frame import level, saturated_share
from auditor.measurement.pairwise_views import OF_TWO, joined
from auditor.measurement.shared_view import FrameArrays, Mask, matched
from auditor.model.checks import Pair, PairFaultFeatures, rig_pair_checks
from auditor.model.frames import CameraImage, Frame, PointCloud
from auditor.model.measurement import Counts, Coverage
from auditor.model.rig import LIDAR, Rig, Triple

Made = TypeVar("Made")


@runtime_checkable
class CameraAttack(Protocol):
    """Changes the data of one camera. It is hashable, and equal attacks do the same."""

    @property
    def name(self) -> str: ...  # noqa: D102 - the kind of attack
    @property
    def parameters(self) -> dict[str, object]: ...  # noqa: D102 - everything that decides its effect
    def apply(self, image: CameraImage) -> CameraImage: ...  # noqa: D102


@runtime_checkable
class LidarAttack(Protocol):
    """Changes the data of the LiDAR. It is hashable, and equal attacks do the same."""

    @property
    def name(self) -> str: ...  # noqa: D102 - the kind of attack
    @property
    def parameters(self) -> dict[str, object]: ...  # noqa: D102 - everything that decides its effect
    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud: ...  # noqa: D102


Attack = CameraAttack | LidarAttack
Attacks = Mapping[int, Attack]
"""What is done to each attacked sensor."""


class AttackedFrame:
    """Measures one clean frame under one set of attacks after the other.

    Counts and local ratios are those that measuring the attacked frame would give. Images, views, disparity maps,
    counts and ratios of sensors under the same attack (or none) are made once and used again until `forget_attacks`.
    """

    def __init__(self, frame: Frame, rig: Rig, matcher: Matcher) -> None:
        self.frame = frame
        self.rig = rig
        self.pair_checks = rig_pair_checks(rig)
        self._matcher = matcher
        self._made: dict[tuple[object, ...], object] = {}
        self._seen = self._rectification()
        self._pairs = {pair: _AttackedPair(self, view) for pair, view in self._seen.pairs.items()}

    @property
    def sensors(self) -> tuple[int, ...]:
        """The sensors whose data the frame holds."""
        present = set(self.frame.images) | ({LIDAR} if self.frame.cloud is not None else set())
        return tuple(sensor for sensor in self.rig.sensors if sensor in present)

    @property
    def view_rig(self) -> Rig:
        """The rig that views and disparity maps are of: the ideal one."""
        return self._seen.rig

    @property
    def valid_masks(self) -> Mapping[int, Mask]:
        """(H, W) by camera what it sees of the view, where it does not see all of it."""
        return {}

    def _rectification(self) -> Rectification:
        return rectification(self.rig)

    def counts(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> tuple[Counts | None, ...]:
        """Counts in the order of `rig.triples`; None where a sensor is not there, or the triple was not asked for."""
        wanted = self._measurable(triples)
        return tuple(self._counts(triple, attacks) if triple in wanted else None for triple in self.rig.triples)

    def ratios(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> tuple[float | None, ...]:
        """Local ratios in the order of `elements`, as far as measuring these triples gives them."""
        wanted = self._measurable(triples)
        pairs = matched(wanted)
        cameras = sorted({sensor for t in wanted for sensor in t if sensor != LIDAR})
        collected = [self.frame_checks(i, k, attacks, matched=(i, k) in pairs) for i, k in combinations(cameras, 2)]
        cells = {pair_check: of_it for one in collected for pair_check, of_it in one.cells.items()}
        shares = {pair_check: share for one in collected for pair_check, share in one.shares.items()}
        return windowed_ratios(self.pair_checks, cells, shares)

    def fingerprint(self, sensor: int, attacks: Attacks) -> int:
        """Tells whether the data of a sensor that is there change, under these attacks."""

        def take() -> int:
            if sensor == LIDAR:
                return fingerprint_of_points(self.cloud(attacks).xyz_m)
            return fingerprint_of_image(self.rectified(sensor, attacks))

        return self.memoise("fingerprint", sensor, attacks, (sensor,), take)

    def coverage(self, camera: int, attacks: Attacks) -> Coverage:
        """How bright a camera's image is under these attacks."""

        def look() -> Coverage:
            pixels = grey(self.rectified(camera, attacks))
            return Coverage(saturated_share=saturated_share(pixels), level=level(pixels))

        return self.memoise("coverage", camera, attacks, (camera,), look)

    def pairs(self, triples: Collection[Triple] | None = None) -> list[Pair]:
        """The pairs (i, k) that are matched to measure these triples."""
        return matched(self._measurable(triples))

    def fault_features(self, pair: Pair, attacks: Attacks, before: FeatureInputs | None) -> PairFaultFeatures:
        """The symptoms of a matched pair under these attacks; `before` is what the frame before has of it."""
        own = OF_TWO if self._pairs else pair
        return self.memoise(
            "symptoms",
            (pair, before),
            attacks,
            (LIDAR, *pair),
            lambda: fault_features_of(self.prepared(pair, attacks), before)[own],
        )

    def symptoms_after(self, pair: Pair, attacks: Attacks, after: "AttackedFrame") -> PairFaultFeatures:
        """The symptoms of a pair matched in the clean frame `after` this one, which is under these attacks."""
        own = OF_TWO if after._pairs else pair
        return self.memoise(
            "symptoms after",
            (pair, after),
            attacks,
            (LIDAR, *pair),
            lambda: fault_features_of(after.prepared(pair, {}), self.earlier(pair, attacks))[own],
        )

    def earlier(self, pair: Pair, attacks: Attacks) -> FeatureInputs | None:
        """What the next frame's symptoms of a pair take of this one; None where a pair of its own view begins anew."""
        if pair in self.pairs():
            return self.prepared(pair, attacks)
        there = [camera for camera in pair if camera in self.frame.images]
        return None if self._seen.pairs else FeatureInputs({camera: self._half(camera, attacks) for camera in there})

    def prepared(self, pair: Pair, attacks: Attacks) -> FeatureInputs:
        """What symptoms take of a matched pair under these attacks."""

        def make() -> FeatureInputs:
            if self._pairs:
                return self._pairs[pair].prepared(OF_TWO, of_two(attacks, pair))
            i, k = pair
            half_res = {camera: self._half(camera, attacks) for camera in pair}
            maps = {pair: self.stereo_map(i, k, attacks)}
            views = {k: self.lidar_view(k, attacks)} if self.frame.cloud is not None else {}
            checks = self.frame_checks(i, k, attacks)
            arrays = FrameArrays(self._seen.rig, half_res, {}, maps, views, checks, valid_masks=self.valid_masks)
            return feature_inputs(arrays)

        return self.memoise("prepared", pair, attacks, (LIDAR, *pair), make)

    def match_together(self, cases: Iterable[Attacks], triples: Collection[Triple] | None = None) -> None:
        """Make the maps of all these cases at once, where the matcher gains by that: a network on a GPU does."""
        if not isinstance(self._matcher, PairMatcher):
            return
        pairs, cases = matched(self._measurable(triples)), list(cases)
        if not self._pairs:
            self.match_pairs(pairs, cases)
            return
        for pair in pairs:
            self._pairs[pair].match_pairs([OF_TWO], [of_two(attacks, pair) for attacks in cases])

    def match_pairs(self, pairs: Sequence[Pair], cases: Sequence[Attacks]) -> None:
        """Make the maps of these pairs, which share a view, of all cases at once."""
        wanted = {((i, attacks.get(i)), (k, attacks.get(k))): attacks for attacks in cases for i, k in pairs}
        missing = {key: attacks for key, attacks in wanted.items() if _map_key(*key) not in self._made}
        of_image = {image: attacks for key, attacks in missing.items() for image in key}
        images = {image: self._matched(image[0], attacks) for image, attacks in of_image.items()}
        texture = {image: self._texture(image[0], attacks) for image, attacks in of_image.items()}
        for (source, reference), found in stereo_maps(self._matcher, images, texture, missing).items():
            self._made[_map_key(source, reference)] = found

    def forget_attacks(self) -> None:
        """Keep only what was made of clean data."""
        self._made = {key: made for key, made in self._made.items() if not any(key[2:])}
        for pair in self._pairs.values():
            pair.forget_attacks()

    def _measurable(self, triples: Collection[Triple] | None) -> tuple[Triple, ...]:
        """Those of the triples asked for whose sensors are all there."""
        present = frozenset(self.sensors)
        wanted = self.rig.triples if triples is None else triples
        return tuple(triple for triple in wanted if present.issuperset(triple))

    def _counts(self, triple: Triple, attacks: Attacks) -> Counts:
        def count() -> Counts:
            i, j, k = triple
            rig = self._seen.rig
            if i == LIDAR and self._pairs:
                (counts,) = self._pairs[j, k].counts(of_two(attacks, (j, k)))
                return cast(Counts, counts)
            second = self.stereo_map(j, k, attacks)
            if i == LIDAR:
                return compare_with_lidar(self.lidar_view(k, attacks), second, j).counts
            baselines = rig.baseline_m(i, k), rig.baseline_m(j, k)
            return compare_cameras(self.stereo_map(i, k, attacks), second, *baselines).counts

        return self.memoise("counts", triple, attacks, triple, count)

    def frame_checks(self, i: int, k: int, attacks: Attacks, *, matched: bool = True) -> FrameChecks:
        """What the witnesses say of two cameras i < k under these attacks, and the LiDAR in k's view if it is there.

        Without having `matched` them that is only what needs no disparities.
        """

        def collect() -> FrameChecks:
            half_res = {camera: self._half(camera, attacks) for camera in (i, k)}
            maps = {(i, k): self.stereo_map(i, k, attacks)} if matched else {}
            views = {k: self.lidar_view(k, attacks)} if matched and self.frame.cloud is not None else {}
            if self._pairs:
                of_pairs = {pair: self._pairs[pair].frame_checks(*OF_TWO, of_two(attacks, pair)) for pair in maps}
                return joined(of_pairs, half_res, views, self._seen.rig)
            return collect_checks(half_res, maps, views, self._seen.rig)

        return self.memoise("testimony", (i, k), attacks, (LIDAR, i, k) if matched else (i, k), collect)

    def stereo_map(self, i: int, k: int, attacks: Attacks) -> StereoMap:
        """DM_{i,k} under these attacks, in the common view."""

        def match() -> StereoMap:
            if self._pairs:
                own = self._pairs[i, k].stereo_map(*OF_TWO, of_two(attacks, (i, k)))
                return self._seen.pairs[i, k].to_shared.stereo(own)
            reference, source = self._matched(k, attacks), self._matched(i, attacks)
            return stereo_map(self._matcher, reference, source, self._texture(k, attacks), self._texture(i, attacks))

        return self.memoise("map", (i, k), attacks, (i, k), match)

    def lidar_view(self, k: int, attacks: Attacks) -> LidarView:
        """The LiDAR's points in the view of camera k under these attacks."""
        return self.memoise("view", k, attacks, (LIDAR,), lambda: lidar_view(self.cloud(attacks), self._seen.rig, k))

    def cloud(self, attacks: Attacks) -> PointCloud:
        """The data of the LiDAR under these attacks."""

        def change() -> PointCloud:
            cloud, attack = self.frame.cloud, attacks.get(LIDAR)
            assert cloud is not None
            return cloud if attack is None else cast(LidarAttack, attack).apply(cloud, self.rig)

        return self.memoise("cloud", LIDAR, attacks, (LIDAR,), change)

    def _texture(self, camera: int, attacks: Attacks) -> NDArray[np.bool_]:
        return self.memoise("texture", camera, attacks, (camera,), lambda: textured(self._half(camera, attacks)))

    def _half(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        return self.memoise("half", camera, attacks, (camera,), lambda: halve(grey(self._matched(camera, attacks))))

    def _matched(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        """The rectified image as the matcher wants it."""

        def change() -> NDArray[np.uint8]:
            pixels = self.rectified(camera, attacks)
            return pixels if self._matcher.colour else grey(pixels)

        return self.memoise("matched", camera, attacks, (camera,), change)

    def rectified(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        """The rectified image of a camera under these attacks, (H, W) or (H, W, 3)."""

        def change() -> NDArray[np.uint8]:
            image = replace(self.frame.images[camera], pixels=self.pixels(camera, attacks))
            return self._seen.image(image).pixels

        return self.memoise("rectified", camera, attacks, (camera,), change)

    def pixels(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        """The image of a camera under these attacks, (H, W) or (H, W, 3) as the frame holds it."""

        def change() -> NDArray[np.uint8]:
            image, attack = self.frame.images[camera], attacks.get(camera)
            return image.pixels if attack is None else cast(CameraAttack, attack).apply(image).pixels

        return self.memoise("pixels", camera, attacks, (camera,), change)

    def memoise(
        self, what: str, which: object, attacks: Attacks, sensors: Collection[int], make: Callable[[], Made]
    ) -> Made:
        """What depends on the data of these sensors only, made once for each attack on them."""
        key = (what, which, *(attacks.get(sensor) for sensor in sensors))
        if key not in self._made:
            self._made[key] = make()
        return cast(Made, self._made[key])


class _AttackedPair(AttackedFrame):
    """The bench of a pair with a view of its own: a rig of two, whose attacked data is the whole bench's."""

    def __init__(self, whole: AttackedFrame, view: PairView) -> None:
        self._whole, self._view = whole, view
        super().__init__(view.recorded(whole.frame), whole.rig.pair(*view.cameras), whole._matcher)

    def _rectification(self) -> Rectification:
        return self._view.seen

    @property
    def valid_masks(self) -> Mapping[int, Mask]:
        """What each of both sees."""
        return self._view.valid_masks

    def stereo_map(self, i: int, k: int, attacks: Attacks) -> StereoMap:
        """DM_{1,2}, where both see."""
        found, valid_masks = super().stereo_map(i, k, attacks), self._view.valid_masks
        return self.memoise("seen map", (i, k), attacks, (i, k), lambda: within(found, valid_masks[k], valid_masks[i]))

    def cloud(self, attacks: Attacks) -> PointCloud:
        """That of the whole bench."""
        return self._whole.cloud(attacks)

    def pixels(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        """That of the whole bench."""
        number, attack = self._view.cameras[camera - 1], attacks.get(camera)
        return self._whole.pixels(number, {} if attack is None else {number: attack})


def of_two(attacks: Attacks, pair: Pair) -> Attacks:
    """The attacks on the LiDAR and on a pair's cameras, under the numbers that these have in a rig of two."""
    return {number: attacks[sensor] for number, sensor in enumerate((LIDAR, *pair)) if sensor in attacks}


AttackedCamera = tuple[int, Attack | None]


def _map_key(source: AttackedCamera, reference: AttackedCamera) -> tuple[object, ...]:
    """The key of `once` for a disparity map."""
    (i, on_i), (k, on_k) = source, reference
    return ("map", (i, k), on_i, on_k)


@dataclass(frozen=True, eq=False)
class InTime:
    """A frame under attack between the clean frames before and after it; None where there is none."""

    attacked_frame: AttackedFrame
    before: AttackedFrame | None
    after: AttackedFrame | None

"""One frame under many attacks: only what an attack changes is measured again."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar, cast

from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.kinds import OnCamera, OnLidar
from auditor.lab.evaluation.experiments import Attack, Attacks, of_two
from auditor.measurement.checks.collect import (
    FrameChecks,
    collect_checks,
    shares_of_a_third,
    shares_of_ranges,
    with_pairs,
)
from auditor.measurement.count_grid import ImageGrid
from auditor.measurement.disparity.disparity_error import compare_cameras, compare_with_lidar
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.disparity.matchers import Matcher
from auditor.measurement.disparity.matchers.interface import for_pair, takes_pairs
from auditor.measurement.disparity.rectification import PairView, RigRectification, rectification
from auditor.measurement.disparity.stereo import StereoMap, stereo_map, stereo_maps, textured, within
from auditor.measurement.fault_features.added_light import saturated_by_light
from auditor.measurement.fault_features.collect import (
    FeatureInputs,
    fault_features_of,
    feature_inputs,
    fingerprint_of_image,
    fingerprint_of_points,
)
from auditor.measurement.frame import brightness
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.pairwise_views import OF_TWO
from auditor.measurement.shared_view import FrameArrays, matched
from auditor.model.arrays import Image, Mask
from auditor.model.checks import CountedPair, Pair, SensorCheck, rig_sensor_checks
from auditor.model.fault_features import PairFaultFeatures
from auditor.model.frames import Frame, PointCloud
from auditor.model.measurement import Cells, Counts, Coverage
from auditor.model.rig import LIDAR, Rig, Triple

Made = TypeVar("Made")


class AttackedFrame:
    """Measures one clean frame under one set of attacks after the other.

    Counts and statistics are those that measuring the attacked frame would give. Images, views, disparity maps, counts
    and checks of sensors under the same attack (or none) are made once and used again until `forget_attacks`.
    """

    def __init__(self, frame: Frame, rig: Rig, matcher: Matcher) -> None:
        self.frame = frame
        self.rig = rig
        self.sensor_checks = rig_sensor_checks(rig)
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
        """(H, W) valid mask by camera, of cameras that do not see the whole view."""
        return {}

    @property
    def grid(self) -> ImageGrid | None:
        """The grid of the cameras' images, None where they are in this view."""
        return None

    def _rectification(self) -> RigRectification:
        return rectification(self.rig)

    def counts(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> tuple[Counts | None, ...]:
        """Counts in the order of `measured_triples`; None where a sensor is not there, or it was not requested."""
        wanted = self._measurable(triples)
        every = self.rig.measured_triples
        return tuple(self._counts(triple, attacks) if triple in wanted else None for triple in every)

    def statistics(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> tuple[float | None, ...]:
        """The statistics in the order of `sensor_checks`, as far as measuring these triples gives them."""
        collected = [self.frame_checks(pair, attacks) for pair in self.pairs(triples)]
        shares = {check: share for one in collected for check, share in one.shares.items()}
        shares |= shares_of_ranges({pair: said for one in collected for pair, said in one.ranges.items()})
        shares |= self._of_a_third(attacks, self.pairs(triples))
        return sensor_statistics(self.sensor_checks, _cells(collected), shares)

    def _of_a_third(self, attacks: Attacks, pairs: Collection[Pair]) -> dict[SensorCheck, float]:
        """What each camera shows that two others do not: of all pairs at once, which are in one view."""
        if self._pairs:
            return {}
        half_res = {camera: self._half(camera, attacks) for pair in pairs for camera in pair}
        maps = {pair: self.stereo_map(*pair, attacks) for pair in pairs}
        return shares_of_a_third(FrameViews(half_res, {}, maps, {}, self._seen.rig))

    def saturated_px(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> dict[int, int]:
        """What saturates in added light by camera, as far as measuring these triples gives it."""
        cells = _cells([self.frame_checks(pair, attacks) for pair in self.pairs(triples)])
        half_res = {camera: self._half(camera, attacks) for camera in self.sensors if camera != LIDAR}
        return saturated_by_light(cells, half_res)

    def fingerprint(self, sensor: int, attacks: Attacks) -> int:
        """The fingerprint of a present sensor's data under these attacks: equal data have equal ones."""

        def take() -> int:
            if sensor == LIDAR:
                return fingerprint_of_points(self.cloud(attacks).xyz_m)
            return fingerprint_of_image(self.rectified(sensor, attacks))

        return self.memoise("fingerprint", sensor, attacks, (sensor,), take)

    def coverage(self, camera: int, attacks: Attacks) -> Coverage:
        """The brightness of a camera's image under these attacks."""

        def take() -> Coverage:
            image = self.rectified(camera, attacks)
            return brightness(image, grey(image))

        return self.memoise("coverage", camera, attacks, (camera,), take)

    def returns(self, attacks: Attacks) -> int | None:
        """The LiDAR points in the leftmost reference's view under these attacks; None where nothing compares them."""
        references = [triple.k for triple in self._measurable(None) if triple.i == LIDAR]
        return self.lidar_view(max(references), attacks).returns if references else None

    def pairs(self, triples: Collection[Triple] | None = None) -> list[Pair]:
        """The pairs (i, k) that are matched to measure these triples."""
        return matched(self._measurable(triples))

    def fault_features(self, pair: Pair, attacks: Attacks, before: FeatureInputs | None) -> PairFaultFeatures:
        """The fault features of a matched pair under these attacks; `before` is the frame before, as prepared."""
        own = OF_TWO if self._pairs else pair
        return self.memoise(
            "fault features",
            (pair, before),
            attacks,
            (LIDAR, *pair),
            lambda: fault_features_of(self.prepared(pair, attacks), before)[own],
        )

    def fault_features_after(self, pair: Pair, attacks: Attacks, after: "AttackedFrame") -> PairFaultFeatures:
        """The fault features of a pair in the clean frame `after` this one, which is under these attacks."""
        own = OF_TWO if after._pairs else pair
        return self.memoise(
            "fault features after",
            (pair, after),
            attacks,
            (LIDAR, *pair),
            lambda: fault_features_of(after.prepared(pair, {}), self.earlier(pair, attacks))[own],
        )

    def earlier(self, pair: Pair, attacks: Attacks) -> FeatureInputs | None:
        """This frame, prepared for the next one's fault features; None where a pair of its own view begins anew."""
        if pair in self.pairs():
            return self.prepared(pair, attacks)
        there = [camera for camera in pair if camera in self.frame.images]
        return None if self._seen.pairs else FeatureInputs({camera: self._half(camera, attacks) for camera in there})

    def prepared(self, pair: Pair, attacks: Attacks) -> FeatureInputs:
        """This frame, prepared for the fault features of a matched pair, under these attacks."""

        def make() -> FeatureInputs:
            if self._pairs:
                return self._pairs[pair].prepared(OF_TWO, of_two(attacks, pair))
            i, k = pair
            half_res = {camera: self._half(camera, attacks) for camera in pair}
            maps = {pair: self.stereo_map(i, k, attacks)}
            views = {k: self.lidar_view(k, attacks)} if self.frame.cloud is not None else {}
            checks = self.frame_checks(pair, attacks)
            arrays = FrameArrays(self._seen.rig, half_res, {}, maps, views, checks, valid_masks=self.valid_masks)
            return feature_inputs(arrays)

        return self.memoise("prepared", pair, attacks, (LIDAR, *pair), make)

    def match_together(self, cases: Iterable[Attacks], triples: Collection[Triple] | None = None) -> None:
        """Make the maps of all these cases at once, where that is faster for the matcher, as for a network on a GPU."""
        if not takes_pairs(self._matcher):
            return
        pairs, cases = matched(self._measurable(triples)), list(cases)
        if not self._pairs:
            self.match_pairs(pairs, cases)
            return
        for pair in pairs:
            self._pairs[pair].match_pairs([OF_TWO], [of_two(attacks, pair) for attacks in cases])

    def match_pairs(self, pairs: Sequence[Pair], cases: Sequence[Attacks]) -> None:
        """Make the maps of these pairs, which share a view, of all cases at once."""
        assert takes_pairs(self._matcher)
        wanted = {((i, attacks.get(i)), (k, attacks.get(k))): attacks for attacks in cases for i, k in pairs}
        missing = {key: attacks for key, attacks in wanted.items() if _map_key(*key) not in self._made}
        of_image = {image: attacks for key, attacks in missing.items() for image in key}
        images = {image: self._matched(image[0], attacks) for image, attacks in of_image.items()}
        texture = {image: self._texture(image[0], attacks) for image, attacks in of_image.items()}
        for (source, reference), stereo in stereo_maps(self._matcher, images, texture, missing).items():
            self._made[_map_key(source, reference)] = stereo

    def forget_attacks(self) -> None:
        """Keep only results of clean data."""
        self._made = {key: made for key, made in self._made.items() if not any(key[2:])}
        for pair in self._pairs.values():
            pair.forget_attacks()

    def _measurable(self, triples: Collection[Triple] | None) -> tuple[Triple, ...]:
        """The requested triples that the rig can measure, and whose sensors are all present."""
        present = frozenset(self.sensors)
        measured = self._seen.triples
        wanted = measured if triples is None else triples
        return tuple(triple for triple in wanted if triple in measured and present.issuperset(triple))

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

    def frame_checks(self, pair: Pair, attacks: Attacks) -> FrameChecks:
        """The checks of a matched pair (i, k) under these attacks, and of the LiDAR in k's view if it is present."""
        i, k = pair

        def collect() -> FrameChecks:
            half_res = {camera: self._half(camera, attacks) for camera in pair}
            views = {k: self.lidar_view(k, attacks)} if self.frame.cloud is not None else {}
            if self._pairs:
                own = self._pairs[pair].frame_checks(OF_TWO, of_two(attacks, pair))
                return with_pairs(collect_checks(half_res, {}, {}, views, self._seen.rig), {pair: own}, OF_TWO)
            maps = {pair: self.stereo_map(i, k, attacks)}
            colours = self._colours(pair, attacks)
            return collect_checks(half_res, colours, maps, views, self._seen.rig, self.grid, self.valid_masks)

        return self.memoise("checks", pair, attacks, (LIDAR, *pair), collect)

    def stereo_map(self, i: int, k: int, attacks: Attacks) -> StereoMap:
        """DM_{i,k} under these attacks, in the common view."""

        def match() -> StereoMap:
            if self._pairs:
                own = self._pairs[i, k].stereo_map(*OF_TWO, of_two(attacks, (i, k)))
                return self._seen.pairs[i, k].to_shared.stereo(own)
            reference, source = self._matched(k, attacks), self._matched(i, attacks)
            matcher = for_pair(self._matcher, self._seen.rig, i, k)
            return stereo_map(matcher, reference, source, self._texture(k, attacks), self._texture(i, attacks))

        return self.memoise("map", (i, k), attacks, (i, k), match)

    def lidar_view(self, k: int, attacks: Attacks) -> LidarView:
        """The LiDAR's points in the view of camera k under these attacks."""
        return self.memoise("view", k, attacks, (LIDAR,), lambda: lidar_view(self.cloud(attacks), self._seen.rig, k))

    def cloud(self, attacks: Attacks) -> PointCloud:
        """The data of the LiDAR under these attacks."""

        def change() -> PointCloud:
            cloud, attack = self.frame.cloud, attacks.get(LIDAR)
            assert cloud is not None
            return cloud if attack is None else cast(OnLidar, attack).apply(cloud, self.rig)

        return self.memoise("cloud", LIDAR, attacks, (LIDAR,), change)

    def _texture(self, camera: int, attacks: Attacks) -> Mask:
        return self.memoise("texture", camera, attacks, (camera,), lambda: textured(self._half(camera, attacks)))

    def _half(self, camera: int, attacks: Attacks) -> Image:
        return self.memoise("half", camera, attacks, (camera,), lambda: halve(grey(self._matched(camera, attacks))))

    def _colours(self, pair: Pair, attacks: Attacks) -> dict[int, Image]:
        """The half-resolution images (h, w, 3) of those of two cameras that have colours."""
        images = {camera: self.rectified(camera, attacks) for camera in pair}
        return {
            camera: self.memoise("colours", camera, attacks, (camera,), partial(halve, pixels))
            for camera, pixels in images.items()
            if pixels.ndim > 2
        }

    def _matched(self, camera: int, attacks: Attacks) -> Image:
        """The rectified image in the matcher's colours."""

        def change() -> Image:
            pixels = self.rectified(camera, attacks)
            return pixels if self._matcher.colour else grey(pixels)

        return self.memoise("matched", camera, attacks, (camera,), change)

    def rectified(self, camera: int, attacks: Attacks) -> Image:
        """The rectified image of a camera under these attacks, (H, W) or (H, W, 3)."""

        def change() -> Image:
            image = replace(self.frame.images[camera], pixels=self.pixels(camera, attacks))
            return self._seen.image(image).pixels

        return self.memoise("rectified", camera, attacks, (camera,), change)

    def pixels(self, camera: int, attacks: Attacks) -> Image:
        """The image of a camera under these attacks, (H, W) or (H, W, 3) as the frame holds it."""

        def change() -> Image:
            image, attack = self.frame.images[camera], attacks.get(camera)
            return image.pixels if attack is None else cast(OnCamera, attack).apply(image).pixels

        return self.memoise("pixels", camera, attacks, (camera,), change)

    def memoise(
        self, subject: str, which: object, attacks: Attacks, sensors: Collection[int], make: Callable[[], Made]
    ) -> Made:
        """A result that depends only on the data of these sensors: made once for each attack on them, then kept."""
        key = (subject, which, *(attacks.get(sensor) for sensor in sensors))
        if key not in self._made:
            self._made[key] = make()
        return cast(Made, self._made[key])


class _AttackedPair(AttackedFrame):
    """The attacked frame of a pair with a view of its own: a rig of two, with the data of the whole attacked frame."""

    def __init__(self, whole: AttackedFrame, view: PairView) -> None:
        self._whole, self._view = whole, view
        super().__init__(view.recorded(whole.frame), whole.rig.pair(*view.cameras), whole._matcher)

    def _rectification(self) -> RigRectification:
        return self._view.seen

    @property
    def valid_masks(self) -> Mapping[int, Mask]:
        """The valid mask of each of the two cameras."""
        return self._view.valid_masks

    @property
    def grid(self) -> ImageGrid:
        """The grid of the common view."""
        return self._view.to_shared.grid

    def stereo_map(self, i: int, k: int, attacks: Attacks) -> StereoMap:
        """DM_{1,2}, where both cameras see."""
        stereo, valid_masks = super().stereo_map(i, k, attacks), self._view.valid_masks
        return self.memoise(
            "masked map", (i, k), attacks, (i, k), lambda: within(stereo, valid_masks[k], valid_masks[i])
        )

    def cloud(self, attacks: Attacks) -> PointCloud:
        """The data of the whole attacked frame."""
        return self._whole.cloud(attacks)

    def pixels(self, camera: int, attacks: Attacks) -> Image:
        """The data of the whole attacked frame."""
        number, attack = self._view.cameras[camera - 1], attacks.get(camera)
        return self._whole.pixels(number, {} if attack is None else {number: attack})


AttackedCamera = tuple[int, Attack | None]


def _map_key(source: AttackedCamera, reference: AttackedCamera) -> tuple[object, ...]:
    """The key of `memoise` for a disparity map."""
    (i, on_i), (k, on_k) = source, reference
    return ("map", (i, k), on_i, on_k)


@dataclass(frozen=True, eq=False)
class InTime:
    """An attacked frame between the clean frames before and after it; None where there is none."""

    attacked_frame: AttackedFrame
    before: AttackedFrame | None
    after: AttackedFrame | None


def _cells(collected: Iterable[FrameChecks]) -> dict[CountedPair, Cells]:
    """The counts of some pairs together."""
    return {counted: grid for one in collected for counted, grid in one.cells.items()}

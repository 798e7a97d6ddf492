"""One frame under many attacks: only what an attack changes is measured again."""

from collections.abc import Callable, Collection, Mapping
from typing import Protocol, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from auditor.evidence.comparing import compare_cameras, compare_with_lidar
from auditor.evidence.lidar import LidarView, lidar_view
from auditor.evidence.matchers import Matcher
from auditor.evidence.reduction import grey, halve
from auditor.evidence.stereo import StereoMap, stereo_map
from auditor.evidence.texture import textured
from auditor.frames import CameraImage, Frame, PointCloud
from auditor.results import Counts
from auditor.rig import LIDAR, Rig, Triple

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


class Bench:
    """Measures one clean frame under one set of attacks after the other.

    The counts are those that measuring the attacked frame would give. Images, views, disparity maps and counts of
    sensors under the same attack (or none) are made once and used again until `forget_attacks`.
    """

    def __init__(self, frame: Frame, rig: Rig, matcher: Matcher) -> None:
        self.frame = frame
        self.rig = rig
        self._matcher = matcher
        self._made: dict[tuple[object, ...], object] = {}

    @property
    def sensors(self) -> tuple[int, ...]:
        """The sensors whose data the frame holds."""
        present = set(self.frame.images) | ({LIDAR} if self.frame.cloud is not None else set())
        return tuple(sensor for sensor in self.rig.sensors if sensor in present)

    def counts(self, attacks: Attacks, triples: Collection[Triple] | None = None) -> tuple[Counts | None, ...]:
        """Counts in the order of `rig.triples`; None where a sensor is not there, or the triple was not asked for."""
        present = frozenset(self.sensors)
        wanted = self.rig.triples if triples is None else triples
        return tuple(
            self._counts(triple, attacks) if triple in wanted and present.issuperset(triple) else None
            for triple in self.rig.triples
        )

    def forget_attacks(self) -> None:
        """Keep only what was made of clean data."""
        self._made = {key: made for key, made in self._made.items() if not any(key[2:])}

    def _counts(self, triple: Triple, attacks: Attacks) -> Counts:
        def count() -> Counts:
            i, j, k = triple
            second = self.stereo_map(j, k, attacks)
            if i == LIDAR:
                return compare_with_lidar(self.lidar_view(k, attacks), second, self.rig, j).counts
            baselines = self.rig.baseline_m(i, k), self.rig.baseline_m(j, k)
            return compare_cameras(self.stereo_map(i, k, attacks), second, *baselines).counts

        return self.once("counts", triple, attacks, triple, count)

    def stereo_map(self, i: int, k: int, attacks: Attacks) -> StereoMap:
        """DM_{i,k} under these attacks."""

        def match() -> StereoMap:
            reference, witness = self._matched(k, attacks), self._matched(i, attacks)
            return stereo_map(self._matcher, reference, witness, self._texture(k, attacks), self._texture(i, attacks))

        return self.once("map", (i, k), attacks, (i, k), match)

    def lidar_view(self, k: int, attacks: Attacks) -> LidarView:
        """The LiDAR's points in the view of camera k under these attacks."""
        return self.once("view", k, attacks, (LIDAR,), lambda: lidar_view(self.cloud(attacks), self.rig, k))

    def cloud(self, attacks: Attacks) -> PointCloud:
        """The data of the LiDAR under these attacks."""

        def change() -> PointCloud:
            cloud, attack = self.frame.cloud, attacks.get(LIDAR)
            assert cloud is not None
            return cloud if attack is None else cast(LidarAttack, attack).apply(cloud, self.rig)

        return self.once("cloud", LIDAR, attacks, (LIDAR,), change)

    def _texture(self, camera: int, attacks: Attacks) -> NDArray[np.bool_]:
        return self.once(
            "texture", camera, attacks, (camera,), lambda: textured(halve(grey(self._matched(camera, attacks))))
        )

    def _matched(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        def change() -> NDArray[np.uint8]:
            pixels = self.pixels(camera, attacks)
            return pixels if self._matcher.colour else grey(pixels)

        return self.once("matched", camera, attacks, (camera,), change)

    def pixels(self, camera: int, attacks: Attacks) -> NDArray[np.uint8]:
        """The image of a camera under these attacks, (H, W) or (H, W, 3) as the frame holds it."""

        def change() -> NDArray[np.uint8]:
            image, attack = self.frame.images[camera], attacks.get(camera)
            return image.pixels if attack is None else cast(CameraAttack, attack).apply(image).pixels

        return self.once("pixels", camera, attacks, (camera,), change)

    def once(
        self, what: str, which: object, attacks: Attacks, sensors: Collection[int], make: Callable[[], Made]
    ) -> Made:
        """What depends on the data of these sensors only, made once for each attack on them."""
        key = (what, which, *(attacks.get(sensor) for sensor in sensors))
        if key not in self._made:
            self._made[key] = make()
        return cast(Made, self._made[key])

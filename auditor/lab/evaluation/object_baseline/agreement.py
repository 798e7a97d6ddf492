"""The objects that the sensors of a frame see, and their agreement: the paper's object-level baseline."""

from collections.abc import Iterator

import numpy as np

from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attacks
from auditor.lab.evaluation.object_baseline.detectors import Detection, Detectors, ImageBox, SolidBox, SolidDetection
from auditor.lab.evaluation.object_baseline.detectors.geometric import (
    NEAREST_M,
    find_objects,
    lidar_points,
    stereo_points,
)
from auditor.lab.evaluation.object_baseline.detectors.overlap import BestOverlap, best_partners
from auditor.model.rig import LIDAR, Camera, Rig, Triple

_IN_FRONT_M = 0.5


class AttackedObjects:
    """Finds objects in a frame under one set of attacks after the other; unchanged data are not processed again.

    With a camera detector the objects in images are compared, else the clusters of stereo points; with a cloud
    detector its boxes, else the clusters of LiDAR points.
    """

    def __init__(self, attacked_frame: AttackedFrame, detectors: Detectors) -> None:
        self._frame = attacked_frame
        self._rig = attacked_frame.view_rig
        self._detectors = detectors

    def agreement(self, triple: Triple, attacks: Attacks) -> tuple[BestOverlap, ...]:
        """For each object of one sensor the best intersection over union with an object of the other."""
        return tuple(one for partnered in self._partnered(triple, attacks) for one in partnered)

    def has_scores(self, triple: Triple) -> bool:
        """True where all objects that are compared are of detectors that say how sure they are."""
        return self._detectors.camera is not None and (triple.i != LIDAR or self._detectors.cloud is not None)

    def in_image(self, camera: int, attacks: Attacks) -> tuple[Detection, ...]:
        """The objects of the camera detector; none without a detector."""
        detector = self._detectors.camera
        if detector is None:
            return ()
        return self._frame.memoise(
            "objects in image",
            camera,
            attacks,
            (camera,),
            lambda: detector.detect(self._frame.rectified(camera, attacks)),
        )

    def in_cloud(self, attacks: Attacks) -> tuple[SolidDetection, ...]:
        """The objects of the cloud detector; none without a detector."""
        detector, lidar = self._detectors.cloud, self._rig.lidar
        if detector is None or lidar is None:
            return ()
        return self._frame.memoise(
            "objects in cloud",
            LIDAR,
            attacks,
            (LIDAR,),
            lambda: detector.detect(self._frame.cloud(attacks).xyz_m, lidar.rig_SE3_lidar),
        )

    def _partnered(self, triple: Triple, attacks: Attacks) -> Iterator[tuple[BestOverlap, ...]]:
        """The overlaps of the objects of each two sides that are compared.

        With the LiDAR: it against each camera, or against both cameras' stereo points. Of cameras: each source camera
        against the reference, or the stereo points of one source camera against the other's. Objects in images are
        sought on the same rows. Cameras that do not stand on one line do not share rows and are not compared.
        """
        i, j, k = triple
        camera, cloud = self._detectors.camera, self._detectors.cloud
        named_in_images = camera.labels if camera else None
        if i == LIDAR:
            named_in_clouds = cloud.labels if cloud else None
            size_px = self._size_px(k) if cloud else None
            if camera is None:
                yield best_partners(self._by_lidar(k, attacks), self._by_stereo(j, k, attacks), named_in_clouds)
                return
            for seen in (j, k):
                objects = self._by_lidar(seen, attacks), self.in_image(seen, attacks)
                yield best_partners(*objects, named_in_clouds, named_in_images, size_px=size_px)
        elif camera is None:
            yield best_partners(self._by_stereo(i, k, attacks), self._by_stereo(j, k, attacks))
        elif self._rig.shares_view:
            for source in (i, j):
                reach = self._rig.camera(k).focal_px * self._rig.baseline_m(source, k) / NEAREST_M
                objects = self.in_image(k, attacks), self.in_image(source, attacks)
                yield best_partners(*objects, named_in_images, named_in_images, reach, self._size_px(k))

    def _size_px(self, k: int) -> tuple[int, int]:
        camera = self._rig.camera(k)
        return camera.width_px, camera.height_px

    def _by_lidar(self, k: int, attacks: Attacks) -> tuple[Detection, ...]:
        """The LiDAR's objects in the view of camera k."""
        camera = self._rig.camera(k)
        if self._detectors.cloud is None:
            return self._frame.memoise(
                "clusters",
                k,
                attacks,
                (LIDAR,),
                lambda: find_objects(lidar_points(self._frame.lidar_view(k, attacks), self._rig), camera),
            )
        boxes = [(found, in_view(found.box, camera)) for found in self.in_cloud(attacks)]
        return tuple(Detection(box, found.score, found.label) for found, box in boxes if box is not None)

    def _by_stereo(self, i: int, k: int, attacks: Attacks) -> tuple[Detection, ...]:
        def find() -> tuple[Detection, ...]:
            camera, stereo = self._rig.camera(k), self._frame.stereo_map(i, k, attacks)
            return find_objects(stereo_points(stereo, camera.focal_px, self._rig.baseline_m(i, k)), camera)

        return self._frame.memoise("stereo clusters", (i, k), attacks, (i, k), find)


def scenarios(rig: Rig) -> tuple[Triple, ...]:
    """The paper's two systems of three sensors, those that the rig has."""
    wanted = Triple(LIDAR, 1, rig.n), Triple(1, 2, rig.n)
    return tuple(triple for triple in wanted if triple in rig.triples)


def in_view(box: SolidBox, camera: Camera) -> ImageBox | None:
    """The rectangle around a box in a camera's image; None where it is not wholly in front, or not seen."""
    u, v, depth = camera.projection @ np.append(box.corners_m, np.ones((8, 1)), axis=1).T
    if depth.min() < _IN_FRONT_M:
        return None
    u, v = np.clip(u / depth, 0, camera.width_px), np.clip(v / depth, 0, camera.height_px)
    seen = ImageBox(float(u.min()), float(v.min()), float(u.max()), float(v.max()))
    return seen if seen.area > 0 else None

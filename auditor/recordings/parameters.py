"""Numbers that decide which messages form a frame and which cameras form a rig, and so what is counted of it.

A changed value of SYNCHRONISING needs new COUNTING_VERSIONS. RIG_FINDING needs none: another rig has another id.
"""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, digest, parameter

_SAME = "a tenth of a pixel of a focal length of 1000 px, at 10 m: less than checks tell; by hand"
_WORK = "bounds the memory and the work; no experiment recorded"


@dataclass(frozen=True)
class SensorTiming:
    """How offsets and periods are learnt, and how far a stamp may lie from its frame."""

    most_tolerance_ns: int = parameter(50 * 10**6, unit="ns", source=BY_HAND)
    periods_a_tolerance: int = parameter(4, unit="tolerances a period", source=BY_HAND)
    usual_period_ns: int = parameter(10**8, unit="ns, where a recording is too short to show one", source=BY_HAND)
    fast_share: float = parameter(0.75, unit="share of the slowest sensor's period", source=BY_HAND)


@dataclass(frozen=True)
class FirstLook:
    """How much of a recording is read before its frames are made."""

    samples: int = parameter(40, unit="stamps a sensor", source=BY_HAND)
    most_lag_ns: int = parameter(2 * 10**9, unit="ns between messages of a file", source=BY_HAND)
    most_disorder_ns: int = parameter(
        300 * 10**6, unit="ns of log times between topics", source="10 periods of 30 Hz: so long frames wait"
    )
    most_back: float = parameter(0.25, unit="share of steps in a topic whose log time goes back", source=BY_HAND)


@dataclass(frozen=True)
class FrameWindow:
    """How long messages wait for their frame."""

    most_wait_periods: int = parameter(10, unit="periods", source=BY_HAND)


@dataclass(frozen=True)
class DriveParts:
    """Which files are one recording: parts that follow one another, and files of the same time."""

    most_gap_ns: int = parameter(5 * 10**9, unit="ns between a part's end and the next one's start", source=BY_HAND)
    most_overlap_ns: int = parameter(10**9, unit="ns by which parts may overlap", source=BY_HAND)
    most_overlap_share: float = parameter(0.25, unit="share of the shorter of two parts", source=BY_HAND)
    most_missing: int = parameter(3, unit="parts missing between two", source=BY_HAND)
    most_lengths: float = parameter(2.0, unit="lengths of a part, for each one that is missing", source=BY_HAND)
    most_pause_share: float = parameter(
        0.5, unit="share of the shorter of two parts between which no part is missing", source=BY_HAND
    )
    least_common_share: float = parameter(0.5, unit="share of the shorter of two files side by side", source=BY_HAND)


@dataclass(frozen=True)
class CalibrationChanges:
    """When a calibration counts as changed within a recording, and how often it may."""

    settling_ns: int = parameter(10**9, unit="ns between two messages of one change", source=BY_HAND)
    most: int = parameter(8, unit="changes a rig", source=BY_HAND)
    pictures_a_size: int = parameter(3, unit="pictures, one after the other, that show a new size", source=BY_HAND)


@dataclass(frozen=True)
class SameCalibration:
    """Up to which difference two calibrations are one: drivers that calibrate all the time never say one twice.

    It is a tenth of a pixel, of a focal length of 1000 px where it is an angle or a place: a matcher tells a sixteenth.
    """

    pixel_px: float = parameter(0.1, unit="px of K and P; of P's fourth column at 10 m", source=_SAME)
    tangent: float = parameter(1e-4, unit="of rotations and of coefficients of lenses", source=_SAME)
    place_m: float = parameter(1e-3, unit="m", source=_SAME)


@dataclass(frozen=True)
class StampAgreement:
    """When a stamp is taken for the time of capture, and when the time of recording stands in for it."""

    most_periods: int = parameter(
        3, unit="periods that a stamp's distance to its log time may differ from the usual one", source=BY_HAND
    )
    least_ns: int = parameter(
        200 * 10**6, unit="ns of the same, however short the period: recorders write late under load", source=BY_HAND
    )
    most_ns: int = parameter(
        2 * 10**9, unit="ns of the same up to which a stamp that goes on is kept: recorders stall", source=BY_HAND
    )
    follows: int = parameter(256, unit="messages over which the usual distance follows a drift", source=BY_HAND)
    other_periods: float = parameter(
        1.75, unit="periods by which a sensor's usual distance is another than the others'", source=BY_HAND
    )
    other_least_ns: int = parameter(
        175 * 10**6, unit="ns of the same, however short the period: a camera's latency is up to 150 ms", source=BY_HAND
    )


@dataclass(frozen=True)
class TimeGaps:
    """What of a recording's time a sensor does not cover."""

    most_periods: int = parameter(3, unit="periods between used messages that are no gap", source=BY_HAND)
    edge_periods: float = parameter(1.5, unit="periods at either end of a recording", source=BY_HAND)
    slowest_pace_ns: int = parameter(
        250 * 10**6, unit="ns between frames at which a faster sensor still has a surplus", source=BY_HAND
    )


@dataclass(frozen=True)
class RigLimits:
    """How many cameras are compared with each other: pairs grow with the square of a rig's cameras, triples faster."""

    most_cameras: int = parameter(
        9, unit="cameras a rig: 36 pairs, 119 triples with a LiDAR", source=f"Middlebury's nine views; {_WORK}"
    )
    most_apart_m: float = parameter(
        30.0, unit="m between two cameras of a rig", source="longer than any road train; no experiment recorded"
    )
    positions_agree: float = parameter(
        0.1, unit="share of a distance by which P and tf may differ", source="tf is often of the mounting; by hand"
    )
    positions_agree_m: float = parameter(0.02, unit="m of the same", source=BY_HAND)
    steepest: float = parameter(
        0.7, unit="sine of the angle by which a camera may look up or down", source="cameras of vehicles 0.3; by hand"
    )
    most_exposures_apart_ns: int = parameter(
        50 * 10**6,
        unit="ns between the exposures of two cameras of a rig",
        source="0.7 m at 50 km/h: 5 % of a disparity at 14 m, which Eq. 2 allows; neighbours in nuScenes 20 ms",
    )


@dataclass(frozen=True)
class Sweeps:
    """When a LiDAR's clouds are parts of a sweep: such a rig says so, and so has another id."""

    looked_at: int = parameter(12, unit="first clouds a topic", source=BY_HAND)
    fewest_clouds: int = parameter(4, unit="clouds with points", source=BY_HAND)
    least_step: float = parameter(
        0.6, unit="widths of a part from one to the next", source="whole sweeps 0 to 0.3, sectors 0.9 to 1.1"
    )
    points_quantile: float = parameter(0.9, unit="quantile of a part's points, by azimuth", source=BY_HAND)
    half_turn_rad: float = parameter(2.6, unit="rad from part to part that may be either way", source=BY_HAND)
    neighbours_rad: float = parameter(0.035, unit="rad between two points that follow each other", source=BY_HAND)
    rare_sweeps: float = parameter(0.05, unit="share of the sweeps that lack parts", source=BY_HAND)
    most_periods: float = parameter(1.5, unit="periods of a sweep from its first part to its last", source=BY_HAND)


@dataclass(frozen=True)
class MovingFrames:
    """When a frame of tf moves against another in a recording's beginning, and is not mounted on it."""

    fewest_steps: int = parameter(3, unit="steps, one of which may be a place that was put right", source=BY_HAND)
    step_m: float = parameter(0.1, unit="m of a step", source="mountings that are measured anew move by less; by hand")
    step_rad: float = parameter(0.05, unit="rad of a step, as a change of the rotation matrix", source=BY_HAND)


_PARTS = "KITTI drive 0009: parts of a scan, thinned or without ground, 0.98 and more; other fields 0.61 at most"


@dataclass(frozen=True)
class LidarChoice:
    """Which of several LiDARs a group of cameras is compared with; another rig has another id."""

    cells: tuple[int, int] = parameter((8, 12), unit="rows and columns of a picture's cells", source=BY_HAND)
    nearest_m: float = parameter(1.0, unit="m ahead of a camera, a point", source=BY_HAND)
    least_of_best: float = parameter(
        0.5,
        unit="of what the best one covers that the LiDAR with the most points must cover",
        source="Waymo's LiDARs of 20 m cover more of its cameras than that of 75 m does; by hand",
    )
    part_cell_m: float = parameter(
        2.0, unit="m, side of the cells from above of two clouds in one frame", source=_PARTS
    )
    part_share: float = parameter(
        0.9, unit="of a cloud's points beside those of another in its frame, that it is a part of", source=_PARTS
    )


@dataclass(frozen=True)
class LidarOverlap:
    """Which LiDARs are compared with each other; another rig has another id."""

    cell_m: float = parameter(4.0, unit="m, side of the cells from above that points of both fall into", source=BY_HAND)
    nearest_m: float = parameter(3.0, unit="m: nearer is the vehicle itself", source=BY_HAND)
    farthest_m: float = parameter(35.0, unit="m: as far as they are compared", source=BY_HAND)
    least_share: float = parameter(0.3, unit="of the points of one that the other's stand beside", source=BY_HAND)
    slowest_s: float = parameter(0.16, unit="s between two scans, of each", source="scans at 10 Hz; by hand")
    most: int = parameter(6, unit="LiDARs a rig: 30 comparisons a frame", source="bounds the work; by hand")


@dataclass(frozen=True)
class PointUnits:
    """Which clouds are in metres at all; the others are not read."""

    nearest_m: float = parameter(0.3, unit="m, median range", source="the nearest return of LiDARs that are sold")
    farthest_m: float = parameter(
        300.0, unit="m, median range", source="the farthest return of those; KITTI and nuScenes 6 to 13 m"
    )
    fewest_points: int = parameter(50, unit="points", source=BY_HAND)
    smallest_m: float = parameter(1e-6, unit="m, a coordinate that is not 0", source=BY_HAND)
    largest_m: float = parameter(1e9, unit="m, a coordinate", source="bytes in the other order: 80 % are beyond these")
    least_distances: float = parameter(
        0.5, unit="share of the coordinates within these", source="of a scanner of one row a third may be rounding"
    )


SENSOR_TIMING = SensorTiming()
FIRST_LOOK = FirstLook()
FRAME_WINDOW = FrameWindow()
DRIVE_PARTS = DriveParts()
CALIBRATION_CHANGES = CalibrationChanges()
STAMP_AGREEMENT = StampAgreement()
TIME_GAPS = TimeGaps()


@dataclass(frozen=True)
class PictureDepth:
    """Of how many bits the values of 16-bit pictures are: cameras fill 10 to 14 of them, and write no word about it."""

    pictures: int = parameter(10, unit="first pictures a topic, of which the largest value counts", source=BY_HAND)


@dataclass(frozen=True)
class PictureOrder:
    """When each two bytes of a picture are the other way round than declared: only so its rows are smooth."""

    smoother: float = parameter(
        2.5,
        unit="times less that neighbours differ, of the deviation of all",
        source="of 10 to 14 bits 2.9 to 14 times, of luma for chroma 3.4 to 40; declared rightly at most 1",
    )


@dataclass(frozen=True)
class OddPictures:
    """Pictures that no sensor gives: of three channels without a colour anywhere, or with rows of one level."""

    most_apart: int = parameter(
        7,
        unit="levels between two channels of a pixel",
        source="H.264 rounds chroma by up to 2, of 3.2 levels each; cameras in colour had 54 at least",
    )
    most_tint: int = parameter(
        6, unit="levels more, where all pixels have them", source="a converter's grey of U = V = 127 has 3; by hand"
    )
    least_filled: float = parameter(0.1, unit="share of the rows, of one level that is not black", source=BY_HAND)


@dataclass(frozen=True)
class SensorLike:
    """From which data rate on a topic of an unlisted type may be a camera or a LiDAR, so that it has to be looked at.

    The rate is over the time of the frames. A camera's video of a low bit rate has 30 kB/s, and packets or compressed
    points of the smallest LiDARs 500 kB/s. Tracks of a radar, objects and states of a vehicle have 1 to 150 kB/s, and
    the raw bytes of a serial line of 115,200 baud 11.5 kB/s.
    """

    least_hz: float = parameter(1.0, unit="messages a second: frames have 4 Hz at least", source=BY_HAND)
    bytes_per_s: float = parameter(200e3, unit="bytes a second, whatever the type says", source=BY_HAND)
    blob_bytes_per_s: float = parameter(
        15e3, unit="bytes a second, where the type's definition holds raw bytes, a picture or points", source=BY_HAND
    )


RIG_LIMITS = RigLimits()
SAME_CALIBRATION = SameCalibration()
SWEEPS = Sweeps()
LIDAR_CHOICE = LidarChoice()
LIDAR_OVERLAP = LidarOverlap()
MOVING_FRAMES = MovingFrames()
POINT_UNITS = PointUnits()

PICTURE_DEPTH = PictureDepth()
PICTURE_ORDER = PictureOrder()
ODD_PICTURES = OddPictures()


SENSOR_LIKE = SensorLike()

FINDING_FILES = (DRIVE_PARTS,)
"""All that can change which files form a recording."""

RIG_FINDING = (
    RIG_LIMITS,
    SAME_CALIBRATION,
    PICTURE_DEPTH,
    PICTURE_ORDER,
    ODD_PICTURES,
    SWEEPS,
    LIDAR_CHOICE,
    LIDAR_OVERLAP,
    POINT_UNITS,
    MOVING_FRAMES,
)
"""All that can change which cameras form a rig, what a rig says of them, and how odd pictures are read."""

ACCOUNTING = (SENSOR_LIKE,)
"""All that can change which topics count as sensors that cannot be read; no count and no verdict depends on them."""

SYNCHRONISING = (SENSOR_TIMING, FIRST_LOOK, FRAME_WINDOW, STAMP_AGREEMENT, TIME_GAPS, CALIBRATION_CHANGES)
"""All that can change which messages form a frame, and what of a recording counts as covered."""


def synchronising_digest() -> str:
    """The digest of SYNCHRONISING: equal digests make the same frames of a recording and a rig."""
    return digest(*SYNCHRONISING)

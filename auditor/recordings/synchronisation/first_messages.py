"""What the first messages of a sensor show: the size of its pictures, and some of its points."""

from auditor.model.arrays import Points
from auditor.model.frames import Message
from auditor.recordings.decoding import CloudDecoder, ImageDecoder
from auditor.recordings.decoding.clouds import check_unit
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.parameters import SWEEPS

_POINTS_OF_A_CLOUD = 400  # points of each of the first clouds that are kept, evenly chosen: it bounds the work


def first_size_px(message: Message, decoder: ImageDecoder) -> SizePx:
    """The size of an image that can be decoded. Raises DecodingError."""
    size_px = decoder.size_px(message)
    decoder.pixels(message, colour=False, size_px=size_px)
    return size_px


def first_points(message: Message, decoder: CloudDecoder) -> int:
    """How many points a cloud in metres has. Raises DecodingError."""
    xyz_m = decoder.xyz_m(message)
    check_unit(xyz_m)
    return len(xyz_m)


def thinned(xyz_m: Points, number: int) -> Points:
    """Some of the (N, 3) points of a topic's cloud of a `number`, others than of the one before."""
    step = max(len(xyz_m) // _POINTS_OF_A_CLOUD, 1)
    return xyz_m[number * step // SWEEPS.looked_at :: step].copy()

"""What the first messages of sensors show: the size of pictures, some points, and in which order topics lie."""

from auditor.model.arrays import Points
from auditor.model.frames import Message
from auditor.recordings.decoding import CloudDecoder, ImageDecoder
from auditor.recordings.decoding.clouds import check_unit
from auditor.recordings.decoding.interface import SizePx
from auditor.recordings.parameters import FIRST_LOOK, SWEEPS

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


class FileOrder:
    """Whether the topics of sensors lie one after the other in a file, or out of order, by stamps and log times.

    Behind a clock that jumps back old times do not show the order of topics; nor do times that stand still or go back.
    """

    def __init__(self) -> None:
        # Stamps of one topic may go back a little; log times do so where the recording began again.
        self._by_stamps, self._by_log_times = _Lag(FIRST_LOOK.most_lag_ns), _Lag(0)

    def jump_ns(self, topic: str, stamp_ns: int, log_time_ns: int) -> int:
        """Take the next message of a topic; by how much its clock jumps back there, 0 where it does not."""
        self._by_log_times.take(topic, log_time_ns)
        return self._by_stamps.take(topic, stamp_ns)

    @property
    def interleaved(self) -> bool:
        """Whether the topics, as far as they were seen, can be paired in one read."""
        logged = self._by_log_times
        shuffled = logged.backward > FIRST_LOOK.most_back * logged.steps
        apart = logged.lag_ns > FIRST_LOOK.most_disorder_ns
        return self._by_stamps.lag_ns <= FIRST_LOOK.most_lag_ns and not apart and not shuffled


class _Lag:
    """How far topics lie behind one another, by one clock; one that goes back by more than `most_back_ns` jumps."""

    def __init__(self, most_back_ns: int) -> None:
        self.lag_ns = 0
        self.steps = 0
        self.backward = 0
        self._most_back_ns = most_back_ns
        self._newest_ns = 0
        self._last_ns: dict[str, int] = {}
        self._jumped = False

    def take(self, topic: str, time_ns: int) -> int:
        begins = topic not in self._last_ns
        last_ns = self._last_ns.get(topic, time_ns)
        self._last_ns[topic] = time_ns
        back_ns = last_ns - time_ns if time_ns < last_ns - self._most_back_ns else 0
        self.steps += not begins
        self.backward += back_ns > 0
        self._jumped |= back_ns > 0
        self._newest_ns = max(self._newest_ns, time_ns)
        if not self._jumped and (time_ns > last_ns or begins):
            self.lag_ns = max(self.lag_ns, self._newest_ns - time_ns)
        return back_ns

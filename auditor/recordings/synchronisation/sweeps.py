"""Puts the clouds of a LiDAR that writes its sweeps in parts together, in the order of the recording."""

from collections.abc import Iterator
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.model.rig import Sweep
from auditor.recordings.decoding import Decoders, PartDecoder
from auditor.recordings.parameters import SWEEPS
from auditor.recordings.synchronisation.sectors import Sector, SweepStarts, sector_of, timed_part
from auditor.recordings.synchronisation.window import Waiting


class Assembled(NamedTuple):
    """A sweep with all its messages; `cut` is true for one that the beginning or the end of the recording cut."""

    waiting: Waiting
    cut: bool


class SweepAssembly:
    """Collects the parts of one sweep after the other; `period_ns` is that of whole sweeps.

    A sweep that lacks parts is damaged, but for the first and the last one of a recording, which are cut by its edges.
    """

    def __init__(self, sweep: Sweep, period_ns: int, decoders: Decoders) -> None:
        self._sweep = sweep
        self._most_ns = int(SWEEPS.most_periods * period_ns)
        self._decoders = decoders
        self._starts = SweepStarts(sweep)
        self._parts: list[Waiting] = []
        self._sectors: list[Sector | None] = []
        self._is_first = True

    def add(self, part: Waiting) -> Iterator[Assembled]:
        """Take the next cloud; gives the sweep that ended before it, if one did."""
        sector = self._sector(part)
        begins = self._starts.begins(sector)
        if self._parts and (begins or abs(part.time_ns - self._parts[0].time_ns) > self._most_ns):
            yield self._whole(at_edge=self._is_first)
            self._is_first = False
        self._parts.append(part)
        self._sectors.append(sector)

    def rest(self) -> Iterator[Assembled]:
        """The last sweep."""
        if self._parts:
            yield self._whole(at_edge=True)

    def _sector(self, part: Waiting) -> Sector | None:
        decoder = self._decoders.cloud(part.message.schema, part.message.encoding)
        if part.problem or decoder is None:
            return None
        try:
            if isinstance(decoder, PartDecoder):
                return sector_of(decoder.looks(part.message))
            return sector_of(decoder.xyz_m(part.message))
        except DecodingError:
            return None  # it is decoded again with its frame, and damaged there

    def _whole(self, *, at_edge: bool) -> Assembled:
        parts, self._parts = self._parts, []
        sectors, self._sectors = self._sectors, []
        lacks = self._sweep.parts - len(parts)
        problem = next((part.problem for part in parts if part.problem), "")
        if lacks > 0 and not problem:
            problem = f"the sweep has {len(parts)} of its {self._sweep.parts} parts"
        against = next((part.against for part in parts if part.against), "")
        middle = parts[timed_part(self._sweep, sectors)]
        messages = tuple(part.message for part in parts)
        whole = middle._replace(problem=problem, against=against, parts=messages)
        return Assembled(whole, cut=at_edge and lacks > 0)

"""Numbers that decide which messages form a frame, and so what is counted of it.

A changed value needs a new COUNTING_VERSION.
"""

from dataclasses import dataclass

from auditor.model.parameter import BY_HAND, digest, parameter

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
    most_bytes: int = parameter(512 * 2**20, unit="bytes of sensor data", source=_WORK)
    most_messages: int = parameter(20_000, unit="messages", source=_WORK)
    most_lag_ns: int = parameter(2 * 10**9, unit="ns between messages of a file", source=BY_HAND)


@dataclass(frozen=True)
class FrameWindow:
    """How long messages wait for their frame."""

    most_wait_periods: int = parameter(10, unit="periods", source=BY_HAND)
    most_bytes: int = parameter(96 * 2**20, unit="bytes", source=_WORK)
    message_bytes: int = parameter(512, unit="bytes beside a message's data", source=BY_HAND)
    most_waiting: int = parameter(2048, unit="messages: 1 kHz beside 1 Hz", source=_WORK)
    most_from_before: int = parameter(100, unit="messages after a clock went back", source=BY_HAND)
    most_held_groups: int = parameter(100, unit="frames", source=_WORK)


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
    remembered: int = parameter(64, unit="messages among which a stamp is repeated", source=BY_HAND)
    follows: int = parameter(256, unit="messages over which the usual distance follows a drift", source=BY_HAND)


@dataclass(frozen=True)
class TimeGaps:
    """What of a recording's time a sensor does not cover."""

    most_periods: int = parameter(3, unit="periods between used messages that are no gap", source=BY_HAND)
    edge_periods: float = parameter(1.5, unit="periods at either end of a recording", source=BY_HAND)
    slowest_pace_ns: int = parameter(
        250 * 10**6, unit="ns between frames at which a faster sensor still has a surplus", source=BY_HAND
    )


SENSOR_TIMING = SensorTiming()
FIRST_LOOK = FirstLook()
FRAME_WINDOW = FrameWindow()
STAMP_AGREEMENT = StampAgreement()
TIME_GAPS = TimeGaps()

SYNCHRONISING = (SENSOR_TIMING, FIRST_LOOK, FRAME_WINDOW, STAMP_AGREEMENT, TIME_GAPS)
"""All that can change which messages form a frame, and what of a recording counts as covered."""


def synchronising_digest() -> str:
    """The digest of SYNCHRONISING: equal digests make the same frames of a recording and a rig."""
    return digest(*SYNCHRONISING)

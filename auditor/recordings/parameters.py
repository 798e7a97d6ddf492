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


SENSOR_TIMING = SensorTiming()
FIRST_LOOK = FirstLook()
FRAME_WINDOW = FrameWindow()

SYNCHRONISING = (SENSOR_TIMING, FIRST_LOOK, FRAME_WINDOW)
"""All that can change which messages form a frame."""


def synchronising_digest() -> str:
    """The digest of SYNCHRONISING: equal digests make the same frames of a recording and a rig."""
    return digest(*SYNCHRONISING)

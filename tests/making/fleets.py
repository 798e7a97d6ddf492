"""Stores of a small fleet whose statistics are drawn: nothing is measured, so that many nights take seconds."""

from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from hashlib import sha256

import numpy as np

from auditor.identification.prior import log_odds, statistic_at
from auditor.store import RecordingRecord, Store
from tests.making.drawn_statistics import drawn_statistics
from tests.making.stores import PERIOD_NS, PROCEDURE, add_frames, make_measurement, make_rig

RIG = make_rig(3)
FIRST_DAY = date(2026, 3, 1)
FRAMES = 24


def add_drive(
    store: Store,
    name: str,
    *,
    seed: int,
    vehicle: str = "car1",
    day: int = 0,
    attacked: Collection[int] = (),
    frames: int = FRAMES,
    raised: float = 0.0,
    rig=RIG,
    procedure=PROCEDURE,
) -> str:
    """A measured drive; returns its measurement. `raised` is added to the log odds of each statistic of each frame."""
    rng = np.random.default_rng(seed)
    start = datetime.combine(FIRST_DAY + timedelta(days=day), datetime.min.time(), UTC) + timedelta(hours=8)
    start_ns = int(start.timestamp()) * 10**9 + seed * 3600 * 10**6

    def statistics(frame: int) -> list[float | None]:
        hit = attacked if frames // 4 <= frame < frames - frames // 4 else ()
        drawn = drawn_statistics(rng, rig, hit)
        return [one if one is None else statistic_at(float(log_odds(np.float64(one))) + raised) for one in drawn]

    measured = [
        make_measurement(rig, number, statistics=statistics(number), stamp_ns=start_ns + number * PERIOD_NS)
        for number in range(frames)
    ]
    recording_id = sha256(f"{name}{seed}".encode()).hexdigest()
    record = RecordingRecord(
        recording_id,
        name,
        f"/logs/{name}",
        clock="utc",
        from_ns=start_ns,
        to_ns=start_ns + (frames - 1) * PERIOD_NS,
        vehicle=vehicle,
        date=FIRST_DAY + timedelta(days=day),
    )
    store.write_recording(replace(record, conflicts=()))
    store.write_rig(rig)
    return add_frames(store, rig, recording_id, measured, procedure=procedure)

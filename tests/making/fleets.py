"""Stores of a small fleet whose statistics are drawn: nothing is measured, so that many nights take seconds."""

from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from functools import partial
from hashlib import sha256

import numpy as np

from auditor.identification.prior import log_odds, statistic_at
from auditor.store.records import RecordingRecord
from auditor.store.store import Store
from auditor.store.tables import write_rows
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
    weather: str | None = None,
    place_deg: tuple[float, float] | None = None,
    rig=RIG,
    procedure=PROCEDURE,
) -> str:
    """A measured drive; returns its measurement. `raised` is added to the log odds of each statistic of each frame.

    With a `place_deg` it has GPS fixes, along 240 m to the north of this latitude and longitude.
    """
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
        weather=weather,
    )
    store.write_recording(replace(record, conflicts=()))
    store.write_rig(rig)
    measurement = add_frames(store, rig, recording_id, measured, procedure=procedure)
    if place_deg is not None:
        latitude, longitude = place_deg
        fixes = [(latitude + 1e-4 * number, longitude) for number in range(frames)]
        stamps = [one.stamp_ns for one in measured]
        write_rows(
            "poses", store.path("poses", measurement), map(partial(_fix, measurement), range(frames), stamps, fixes)
        )
    return measurement


def _fix(measurement: str, frame: int, stamp_ns: int, place_deg: tuple[float, float]) -> dict[str, object]:
    known = {"measurement_id": measurement, "frame": frame, "stamp_ns": stamp_ns, "offset_ns": 0, "topic": "/fix"}
    places = {"latitude_deg": place_deg[0], "longitude_deg": place_deg[1], "altitude_m": 10.0}
    absent = dict.fromkeys(("x_m", "y_m", "z_m", "heading_deg"))
    return {**known, "schema": "sensor_msgs/msg/NavSatFix", "frame_id": "gps", **places, **absent}

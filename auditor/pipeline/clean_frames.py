"""What judging and calibrating need of a stored measurement: its statistics, fault features and clean frames."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auditor.errors import StoreError
from auditor.identification.faults import fault_scores
from auditor.identification.statistics import frozen, sensor_statistics
from auditor.identification.transfer import MACHINE
from auditor.model.calibration import CleanFrames
from auditor.model.checks import SHARE_CHECKS, SensorCheck, rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.frames import SensorState
from auditor.model.measurement import Statistic
from auditor.model.rig import LIDAR, Rig
from auditor.store.records import FrameStatistics
from auditor.store.store import Store


def clean_frames_of(
    store: Store, measurement: str, frames: range | None = None, *, recount: bool = False
) -> CleanFrames:
    """What a calibration keeps of a measurement.

    `frames` restricts it to these frame numbers, `recount` computes the statistics again from the stored cells.
    """
    stored = store.measurement(measurement)
    rig, features = store.rig(stored.rig_id), store.load_fault_features(measurement)
    frames_of = frame_statistics(store, measurement, recount=recount)
    present = frames_of.states == SensorState.PRESENT
    chosen = np.array([frames is None or int(number) in frames for number in frames_of.frames], dtype=np.bool_)
    return CleanFrames(
        stored.recording_id,
        frames_of.stamps_ns[chosen],
        {
            (statistic, triple): column
            for statistic in Statistic
            for triple, column in zip(
                rig.measured_triples, store.load_errors(measurement, statistic).E[chosen].T, strict=True
            )
        },
        dict(zip(rig_sensor_checks(rig), frames_of.statistics[chosen].T, strict=True)),
        {cause: column[chosen] for cause, column in fault_scores(features, frames_of.stamps_ns, rig.sensors).items()},
        missing=_of_sensors(rig, ~present[chosen]),
        frozen=_of_sensors(rig, frozen(frames_of.fingerprints, present)[chosen]),
        unmasked=_unmasked(rig, frames_of, chosen),
        features={
            (name, pair): column
            for name in COLUMNS
            for pair, column in zip(features.pairs, features.columns[name][chosen].T, strict=True)
        },
        brightness={key: column[chosen] for key, column in features.by_camera.items()},
        returns=frames_of.returns[chosen] if LIDAR in rig.sensors else np.zeros(0),
        versions={name: stored.versions[name] for name in MACHINE if name in stored.versions},
    )


def _unmasked(rig: Rig, frames: FrameStatistics, chosen: NDArray[np.bool_]) -> dict[SensorCheck, NDArray[np.float64]]:
    """The statistics without the LiDAR of those sensor checks for which they are others in some frame."""
    columns = zip(rig_sensor_checks(rig), frames.statistics[chosen].T, frames.unmasked[chosen].T, strict=True)
    return {one: alone for one, usual, alone in columns if not np.array_equal(usual, alone, equal_nan=True)}


def _of_sensors(rig: Rig, flags: NDArray[np.bool_]) -> dict[int, NDArray[np.bool_]]:
    """(F, S) flags by sensor, without the sensors that have none."""
    return {sensor: column for sensor, column in zip(rig.sensors, flags.T, strict=True) if column.any()}


def frame_statistics(store: Store, measurement: str, *, recount: bool) -> FrameStatistics:
    """The stored statistics of a measurement; with `recount` computed again from the stored cells."""
    stored = store.load_statistics(measurement)
    if not recount:
        return stored
    counted = statistics_from_cells(store, measurement)
    same = stored.unmasked == stored.statistics
    return replace(stored, statistics=counted, unmasked=np.where(same, counted, stored.unmasked))


def statistics_from_cells(store: Store, measurement: str) -> NDArray[np.float64]:
    """(F, M) statistics computed again from the stored cells, as a scan computes them from the images.

    For measurements made before windows or votes were changed. Statistics without cells stay as they were measured.
    Raises StoreError where a scan left cells out.
    """
    sensor_checks = rig_sensor_checks(store.rig(store.measurement(measurement).rig_id))
    counted = [column for column, one in enumerate(sensor_checks) if one.check not in SHARE_CHECKS]
    of_cells = [sensor_checks[column] for column in counted]
    stored = store.load_statistics(measurement)
    statistics, row_of = stored.statistics.copy(), {frame: row for row, frame in enumerate(stored.frames.tolist())}
    lacking = np.asarray((~np.isnan(statistics[:, counted])).any(axis=1))
    for frame, cells in store.load_cells(measurement):
        statistics[row_of[frame], counted] = np.array(sensor_statistics(of_cells, cells, {}), dtype=np.float64)
        lacking[row_of[frame]] = False
    if lacking.any():
        raise StoreError(
            f"of {lacking.sum()} frames no cells were kept",
            where=f"measurement {measurement}",
            remedy="judge without --recount, or measure again with --cells all",
        )
    return statistics

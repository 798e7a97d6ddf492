-- One row a vehicle, day and comparison of sensors: the level of a check on that day, which drift is found in.
--
-- Of a long recording about 200 frames count, evenly spaced. Recordings without a vehicle or a day are left out, as are
-- absent sensors.
--
-- column kind: The rig kind in words, and how it was measured: levels of other kinds are not compared.
-- column vehicle: The vehicle.
-- column day: The day of its recordings: as it was given, or by their stamps where their clock is UTC.
-- column check_name: A check of sensors (see sensor_checks), disparity_error, lidar_disagreement (LiDAR and stereo differ), row_offset and row_misalignment (points on other rows), depth_bias (disparities off by a constant), brightness and texture (of a camera against another), or returns (points in view).
-- column sensors: The sensors that are compared. A sensor drifts where all of its comparisons do.
-- column signed: TRUE where the level is that of the first sensor minus the second.
-- column unit: px, log odds of a share, or the natural logarithm of a ratio.
-- column level: Median over the day's frames; of depth_bias, which is whole pixels, the mean.
-- column frames: How many frames of the day had it measured.
-- column rigs: The rigs of the day: another one was calibrated anew.
WITH driven AS (
    SELECT
        measurement.measurement_id,
        measurement.rig_id,
        measurement.vehicle,
        coalesce(recording.date, CAST(make_timestamp_ns(recording.from_ns) AS DATE)) AS day,
        format('{}, {}, {}', measurement.kind, measurement.matcher, measurement.counting_version) AS kind,
        greatest(measurement.measured // 200, 1) AS step
    FROM measurements AS measurement
    JOIN stored_recordings AS recording USING (recording_id)
    WHERE measurement.vehicle IS NOT NULL AND (recording.date IS NOT NULL OR recording.clock = 'utc')
),
seen AS (
    SELECT frame.*, driven.rig_id, driven.step
    FROM stored_frames AS frame
    JOIN driven USING (measurement_id)
    WHERE frame.skipped IS NULL AND frame.frame % driven.step = 0
),
most_voters AS (
    SELECT *
    FROM stored_sensor_checks
    QUALIFY len(others) = max(len(others)) OVER (PARTITION BY rig_id, check_name, sensor)
),
cameras AS (
    SELECT rig_id, unnest(sensors).sensor AS sensor, generate_subscripts(sensors, 1) AS position FROM stored_rigs
),
camera_pairs AS (
    SELECT i.rig_id, i.sensor AS i, k.sensor AS k, i.position AS of_i, k.position AS of_k
    FROM cameras AS i
    JOIN cameras AS k ON i.rig_id = k.rig_id AND 0 < i.sensor AND i.sensor < k.sensor
),
features AS (
    SELECT feature.*
    FROM stored_fault_features AS feature
    JOIN driven USING (measurement_id)
    WHERE feature.frame % driven.step = 0
),
compared AS (
    SELECT
        seen.measurement_id,
        check_name,
        [sensor] AS sensors,
        FALSE AS signed,
        'log odds' AS unit,
        log_odds(seen.statistics[position], 0.02) AS level
    FROM seen
    JOIN most_voters USING (rig_id)
    UNION ALL
    SELECT
        seen.measurement_id,
        'disparity_error',
        [i, j, k],
        FALSE,
        'log odds',
        log_odds(disparity_error(seen.gated_inconsistent_px[position], seen.gated_valid_px[position]), 0.02)
    FROM seen
    JOIN stored_triples USING (rig_id)
    UNION ALL
    SELECT measurement_id, 'row_offset', [i, k], TRUE, 'px', offset_px FROM features
    UNION ALL
    SELECT measurement_id, 'row_misalignment', [i, k], FALSE, 'log odds', log_odds(1 - row_aligned, 0.02) FROM features
    UNION ALL
    SELECT measurement_id, 'depth_bias', [i, k], TRUE, 'px', bias_px FROM features
    UNION ALL
    SELECT measurement_id, 'lidar_disagreement', [0, i, k], FALSE, 'log odds', log_odds(1 - agreeing, 0.02) FROM features
    UNION ALL
    SELECT measurement_id, 'brightness', [i, k], TRUE, 'logarithm', ln(greatest(seen.level[of_i], 1) / greatest(seen.level[of_k], 1))
    FROM seen
    JOIN camera_pairs USING (rig_id)
    UNION ALL
    SELECT
        measurement_id,
        'texture',
        [i, k],
        TRUE,
        'log odds',
        log_odds(seen.textureless_share[of_i], 0.02) - log_odds(seen.textureless_share[of_k], 0.02)
    FROM seen
    JOIN camera_pairs USING (rig_id)
    UNION ALL
    SELECT measurement_id, 'returns', [0], FALSE, 'logarithm', ln(greatest(seen.returns[1], 1))
    FROM seen
    JOIN cameras ON cameras.rig_id = seen.rig_id AND cameras.sensor = 0
)
SELECT
    driven.kind,
    driven.vehicle,
    driven.day,
    compared.check_name,
    CAST(compared.sensors AS TINYINT[]) AS sensors,
    compared.signed,
    compared.unit,
    CASE WHEN compared.check_name = 'depth_bias' THEN avg(compared.level) ELSE median(compared.level) END AS level,
    count(compared.level) AS frames,
    list(DISTINCT driven.rig_id ORDER BY driven.rig_id) AS rigs
FROM compared
JOIN driven USING (measurement_id)
WHERE isfinite(compared.level)
GROUP BY driven.kind, driven.vehicle, driven.day, compared.check_name, compared.sensors, compared.signed, compared.unit

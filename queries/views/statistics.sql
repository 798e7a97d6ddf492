-- One row a measured frame and sensor check: its statistic, and what the current judgement makes of it.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column position: Place of the sensor check in `statistics`, counted from 1.
-- column check_name: Which check, see the view checks.
-- column sensor: The sensor that it checks.
-- column others: The other sensors by which it is checked, ascending; the view checks says which they are.
-- column statistic: The statistic, 0 to 1; NULL where it was not measured.
-- column mean: What the log odds of a clean frame's statistic are expected to be by the current judgement; NULL where that is not of the robust method.
-- column deviation: The standard deviation of that.
-- column z: Its score (log odds - mean) / deviation, kept between -4 and 12.
SELECT
    frame.measurement_id,
    frame.frame,
    frame.stamp_ns,
    sensor_check.position,
    sensor_check.check_name,
    sensor_check.sensor,
    sensor_check.others,
    frame.statistics[sensor_check.position] AS statistic,
    judgement.check_mean[sensor_check.position] AS mean,
    judgement.check_deviation[sensor_check.position] AS deviation,
    z_score(
        frame.statistics[sensor_check.position],
        judgement.check_mean[sensor_check.position],
        judgement.check_deviation[sensor_check.position],
        judgement.z_offset,
        judgement.z_range
    ) AS z
FROM stored_frames AS frame
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN stored_sensor_checks AS sensor_check USING (rig_id)
LEFT JOIN judgements AS judgement ON judgement.measurement_id = frame.measurement_id AND judgement.current
WHERE frame.skipped IS NULL

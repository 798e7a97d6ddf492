-- One row a measured frame and sensor check: its statistic, and what the current judgement makes of it.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column position: Place of the sensor check in `statistics`, counted from 1.
-- column check_name: Which check: lidar_conflict, added_light, removed_light, photometric_inconsistency, point_dropout, isolated_points, coloured_light, lost_returns, striped_light, false_ranges, rough_ranges, parallax_conflict or still_light.
-- column sensor: The sensor that it checks.
-- column others: The other cameras: those that the camera is compared with; of lidar_conflict, lost_returns and false_ranges all of the pairs that are compared with the LiDAR, of parallax_conflict the one whose past is; of still_light the LiDAR, 0; of point_dropout, isolated_points and rough_ranges the one whose view it is.
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

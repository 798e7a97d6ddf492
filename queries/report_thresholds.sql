-- What the incident report says of the thresholds of a measurement by the robust method: one row a sensor check.
--
-- param measurement VARCHAR: The measurement.
--
-- column position: Place of the sensor check among those of its rig, counted from 1.
-- column check_name: Which check.
-- column sensor: The sensor that it checks.
-- column others: The other cameras.
-- column expected: The statistic that a clean frame is expected to have.
-- column theta: The statistic whose z is the limit.
-- column samples: The number of clean frames that the two were learnt from, 0 where they are the prior.
SELECT
    sensor_check.position,
    sensor_check.check_name,
    sensor_check.sensor,
    sensor_check.others,
    statistic_at_limit(check_mean[position], check_deviation[position], 0, z_offset) AS expected,
    statistic_at_limit(check_mean[position], check_deviation[position], z_limit, z_offset) AS theta,
    check_samples[position] AS samples
FROM judgements AS judgement
JOIN measurements AS measurement USING (measurement_id)
JOIN sensor_checks AS sensor_check USING (rig_id)
WHERE judgement.measurement_id = $measurement AND judgement.current AND z_limit IS NOT NULL
ORDER BY position

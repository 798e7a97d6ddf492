-- One row a measured frame and sensor that may have been attacked, with the portion of it that would be damaged.
--
-- column frame: Number of the frame within the recording.
-- column sensor: The sensor.
-- column attacked: TRUE where the current judgement names the sensor in that frame; NULL where nothing was judged.
SELECT
    region.*,
    list_contains(verdict.attacked, region.sensor) AS attacked
FROM stored_regions AS region
LEFT JOIN verdicts AS verdict USING (measurement_id, frame)

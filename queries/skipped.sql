-- Ticks without a frame, by reason and sensor.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column reason: Why there is no frame.
-- column sensor: The sensor to which that is due, where it is due to one.
-- column ticks: Number of ticks.
-- column share: Their share of the measurement's frames and ticks.
-- column first_frame: Number of the first of them.
-- column last_frame: Number of the last of them.
SELECT
    any_value(measurement.recording_id) AS recording_id,
    any_value(measurement.name) AS name,
    frame.measurement_id,
    frame.skipped AS reason,
    frame.skipped_sensor AS sensor,
    count(*) AS ticks,
    count(*) / any_value(measurement.frames) AS share,
    min(frame.frame) AS first_frame,
    max(frame.frame) AS last_frame
FROM frames AS frame
JOIN measurements AS measurement USING (measurement_id)
WHERE frame.skipped IS NOT NULL
    AND ($recording IS NULL OR measurement.name = $recording OR starts_with(measurement.recording_id, $recording))
GROUP BY frame.measurement_id, frame.skipped, frame.skipped_sensor
ORDER BY name, frame.measurement_id, ticks DESC, reason, sensor

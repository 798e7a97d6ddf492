-- One row a measured frame, with the time since the frame before it of the same sensors, whichever rig that had.
--
-- Rigs of the same topics follow one another where a calibration changes within a recording.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column step_ns: Time since the frame before; NULL of the first frame.
-- column recalibrated: TRUE where the frame before had another rig: the calibration changed between them.
WITH line AS (
    SELECT
        measurement.measurement_id,
        measurement.recording_id,
        measurement.name,
        measurement.rig_id,
        {
            recording: measurement.recording_id,
            matcher: measurement.matcher,
            settings: measurement.settings,
            version: measurement.counting_version,
            topics: [sensor.topic FOR sensor IN rig.sensors]
        } AS line
    FROM measurements AS measurement
    JOIN rigs AS rig USING (rig_id)
)
SELECT
    frame.measurement_id,
    line.recording_id,
    line.name,
    frame.frame,
    frame.stamp_ns,
    frame.stamp_ns - lag(frame.stamp_ns) OVER before AS step_ns,
    coalesce(line.rig_id <> lag(line.rig_id) OVER before, false) AS recalibrated
FROM stored_frames AS frame
JOIN line USING (measurement_id)
WHERE frame.skipped IS NULL
WINDOW before AS (PARTITION BY line.line ORDER BY frame.stamp_ns, frame.frame, line.rig_id)

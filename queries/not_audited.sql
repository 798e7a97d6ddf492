-- What was not audited and why: frames by reason, sensors that were not there, topics, and recordings that nothing was found of. The longest comes first.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
-- param vehicle VARCHAR = NULL: Only the recordings of this vehicle.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column what: frames (skipped, or not auditable by their verdict), sensor (of frames that were audited without it), topic, measurement, recording or input.
-- column reason: Why it was not audited.
-- column sensor_name: The sensor to which that is due, where it is due to one.
-- column topic: The topic.
-- column frames: How many frames or ticks; NULL of what is no frame.
-- column share: Their share of the measurement's frames and ticks.
-- column runs: In how many pieces.
-- column first_frame: Number of the first of them.
-- column last_frame: Number of the last of them.
-- column from_utc: When the first of them was, where the recording's clock is UTC.
-- column remedy: What to do about it, where that is known.
SELECT
    unaudited.name,
    any_value(unaudited.vehicle) AS vehicle,
    unaudited.what,
    unaudited.reason,
    any_value(names_of([unaudited.sensor], rig.sensors)[1]) AS sensor_name,
    any_value(unaudited.topic) AS topic,
    CAST(sum(unaudited.frames) AS BIGINT) AS frames,
    sum(unaudited.frames) / any_value(measurement.frames - coalesce(measurement.skipped['edge'], 0)) AS share,
    CASE WHEN sum(unaudited.frames) IS NOT NULL THEN count(*) END AS runs,
    min(unaudited.first_frame) AS first_frame,
    max(unaudited.last_frame) AS last_frame,
    utc_of(min(unaudited.from_ns), any_value(measurement.clock)) AS from_utc,
    any_value(unaudited.remedy) AS remedy,
    unaudited.recording_id,
    unaudited.measurement_id
FROM unaudited
LEFT JOIN measurements AS measurement USING (measurement_id)
LEFT JOIN rigs AS rig USING (rig_id)
WHERE ($recording IS NULL OR unaudited.name = $recording OR starts_with(unaudited.recording_id, $recording))
    AND ($vehicle IS NULL OR unaudited.vehicle = $vehicle)
GROUP BY
    unaudited.name, unaudited.recording_id, unaudited.measurement_id, unaudited.what, unaudited.reason, unaudited.sensor,
    -- topics and damage are many of one reason
    CASE WHEN unaudited.frames IS NULL THEN unaudited.topic END
ORDER BY frames DESC NULLS FIRST, unaudited.name, unaudited.what, unaudited.reason, sensor_name, topic

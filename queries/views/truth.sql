-- One row a measured frame with the sensors that labels say were attacked in it.
--
-- A label covers a frame whose stamp lies within half a frame's period (at most 50 ms) of it, since the stamps of a
-- sensor and of the frame differ by an offset; a sensor that is not present cannot show its attack.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column truth: The attacked sensors, ascending; empty where no label covers the frame.
-- column labelled: TRUE where the recording has labels at all, of attacks or that it is clean.
WITH step AS (
    SELECT measurement_id, stamp_ns - lag(stamp_ns) OVER (PARTITION BY measurement_id ORDER BY frame) AS step_ns
    FROM stored_frames
    WHERE measurement_id IN (SELECT measurement_id FROM stored_measurements SEMI JOIN labels USING (recording_id))
),
tolerance AS (
    SELECT measurement_id, coalesce(CAST(least(50000000, median(step_ns) / 2) AS BIGINT), 0) AS tolerance_ns
    FROM step GROUP BY measurement_id
),
sensor AS (
    SELECT rig_id, unnest(sensors) AS entry, generate_subscripts(sensors, 1) AS position FROM stored_rigs
),
span AS (
    SELECT measurement_id, entry.sensor, position, from_ns - tolerance_ns AS from_ns, to_ns + tolerance_ns AS to_ns
    FROM labels AS label
    JOIN stored_measurements AS measurement USING (recording_id)
    JOIN tolerance USING (measurement_id)
    JOIN sensor ON sensor.rig_id = measurement.rig_id AND sensor.entry.topic = label.topic
),
covered AS (
    SELECT frame.measurement_id, frame.frame, list(DISTINCT span.sensor ORDER BY span.sensor) AS truth
    FROM stored_frames AS frame
    JOIN span
        ON span.measurement_id = frame.measurement_id AND frame.stamp_ns BETWEEN span.from_ns AND span.to_ns
    WHERE frame.state[span.position] = 'present'
    GROUP BY frame.measurement_id, frame.frame
)
SELECT
    frame.measurement_id,
    frame.frame,
    frame.stamp_ns,
    coalesce(covered.truth, []) AS truth,
    measurement.recording_id IN (SELECT recording_id FROM labels) AS labelled
FROM stored_frames AS frame
JOIN stored_measurements AS measurement USING (measurement_id)
LEFT JOIN covered USING (measurement_id, frame)
WHERE frame.skipped IS NULL

-- One row a run of frames that were not audited for one reason, and one a topic, recording, measurement or input that was not.
--
-- Ticks at the edges of a recording are no frames, and are left out.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column what: frames (skipped, or not auditable by their verdict), sensor (of frames that were audited without it), topic, measurement, recording or input (a path that no recording could be read from).
-- column reason: Why it was not audited.
-- column sensor: The sensor to which that is due, where it is due to one.
-- column topic: The topic.
-- column frames: How many frames or ticks; NULL of what is no frame.
-- column first_frame: Number of the first of them.
-- column last_frame: Number of the last of them.
-- column from_ns: Stamp of the first of them.
-- column to_ns: Stamp of the last of them.
-- column remedy: What to do about it, where that is known.
WITH tick AS (
    SELECT
        frame.measurement_id,
        frame.frame,
        frame.stamp_ns,
        coalesce(
            frame.skipped,
            CASE WHEN verdict.kind = 'not_auditable' THEN coalesce(verdict.reason, 'not auditable') END
        ) AS reason,
        frame.skipped_sensor AS sensor
    FROM stored_frames AS frame
    SEMI JOIN measurements USING (measurement_id)
    LEFT JOIN verdicts AS verdict USING (measurement_id, frame)
    WHERE frame.skipped IS DISTINCT FROM 'edge'
),
lacking AS (
    SELECT measurement_id, frame, stamp_ns, coalesce(state_reason, state) AS reason, sensor, topic
    FROM sensors
    SEMI JOIN measurements USING (measurement_id)
    WHERE state <> 'present'
),
lost AS (
    SELECT *, NULL AS topic, 'frames' AS what FROM tick WHERE reason IS NOT NULL
    UNION ALL BY NAME
    -- a sensor that is not there is no second reason of a frame that was not audited at all
    SELECT lacking.*, 'sensor' AS what
    FROM lacking
    ANTI JOIN (SELECT measurement_id, frame FROM tick WHERE reason IS NOT NULL) AS unaudited USING (measurement_id, frame)
),
run AS (
    SELECT *, frame - row_number() OVER (PARTITION BY measurement_id, what, reason, sensor ORDER BY frame) AS run FROM lost
),
found AS (
    SELECT
        measurement_id,
        what,
        reason,
        sensor,
        any_value(topic) AS topic,
        count(*) AS frames,
        min(frame) AS first_frame,
        max(frame) AS last_frame,
        min(stamp_ns) AS from_ns,
        max(stamp_ns) AS to_ns,
        CASE
            WHEN regexp_matches(reason, 'the calibration changes|change of the calibration')
            THEN 'where one rig does for all of it, give it by --rig (auditor inspect --write-rig writes one)'
        END AS remedy
    FROM run
    GROUP BY measurement_id, what, reason, sensor, run
    UNION ALL BY NAME
    SELECT measurement_id, 'topic' AS what, topic.state || ': ' || topic.reason AS reason, topic.topic, nullif(topic.remedy, '') AS remedy
    FROM (SELECT measurement_id, unnest(coverage) AS topic FROM measurements)
    WHERE topic.state <> 'read'
    UNION ALL BY NAME
    SELECT measurement_id, 'measurement' AS what, 'measured and not judged' AS reason, 'auditor judge' AS remedy
    FROM measurements
    WHERE measurement_id NOT IN (SELECT measurement_id FROM judgements)
    UNION ALL BY NAME
    SELECT measurement_id, 'recording' AS what, 'damaged: ' || unnest(damage) AS reason
    FROM measurements
)
SELECT
    measurement.recording_id,
    measurement.name,
    measurement.vehicle,
    found.*
FROM found
JOIN measurements AS measurement USING (measurement_id)
UNION ALL BY NAME
SELECT recording_id, name, vehicle, 'recording' AS what, 'not measured' AS reason, 'auditor scan' AS remedy
FROM recordings
WHERE recording_id NOT IN (SELECT recording_id FROM stored_measurements)
UNION ALL BY NAME
SELECT recording_id, name, 'input' AS what, concat_ws(': ', outcome, reason) AS reason, remedy
FROM inputs
WHERE outcome NOT IN ('read', 'twin')
UNION ALL BY NAME
-- what the scan said when it ended in 3 or 4; damage and topics have rows of their own
SELECT recording_id, recording.name, recording.vehicle, 'recording' AS what, reason
FROM (SELECT recording_id, unnest(gaps) AS reason FROM inputs) AS gap
JOIN recordings AS recording USING (recording_id)
WHERE NOT starts_with(reason, 'damaged: ')

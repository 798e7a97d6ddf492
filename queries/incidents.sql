-- Incidents: runs of frames with the same attacked sensors.
--
-- param gap_s DOUBLE = 0.5: Frames of one attacked set that are no further apart than this, in seconds, are one incident.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column kind: What the verdicts are: attacked, unidentified or suspect.
-- column attacked: The attacked sensors; empty unless kind is attacked.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column attacked_names: The recording's own names of the attacked sensors.
-- column from_ns: Stamp of the first frame.
-- column to_ns: Stamp of the last frame.
-- column seconds: Time from the first frame to the last.
-- column from_utc: When it began, where the recording's clock is UTC.
-- column frames: Number of frames with this verdict.
-- column first_frame: Number of the first frame.
-- column last_frame: Number of the last frame.
-- column strongest_frame: Number of the frame with the largest margin.
-- column strongest_margin: The largest margin of its frames.
WITH finding AS (
    SELECT
        *,
        lag(stamp_ns) OVER (PARTITION BY measurement_id, kind, attacked ORDER BY stamp_ns, frame) AS previous_ns
    FROM findings
    WHERE $recording IS NULL OR name = $recording OR starts_with(recording_id, $recording)
),
numbered AS (
    SELECT
        *,
        sum(CASE WHEN stamp_ns - previous_ns <= $gap_s * 1e9 THEN 0 ELSE 1 END)
            OVER (PARTITION BY measurement_id, kind, attacked ORDER BY stamp_ns, frame) AS run
    FROM finding
)
SELECT
    any_value(incident.recording_id) AS recording_id,
    any_value(incident.name) AS name,
    any_value(incident.vehicle) AS vehicle,
    incident.measurement_id,
    incident.kind,
    incident.attacked,
    any_value(names_of(incident.attacked, rig.sensors)) AS attacked_names,
    min(stamp_ns) AS from_ns,
    max(stamp_ns) AS to_ns,
    (max(stamp_ns) - min(stamp_ns)) / 1e9 AS seconds,
    CASE WHEN any_value(recording.clock) = 'utc' THEN make_timestamp_ns(min(stamp_ns)) END AS from_utc,
    count(*) AS frames,
    min(frame) AS first_frame,
    max(frame) AS last_frame,
    arg_max(frame, margin) AS strongest_frame,
    max(margin) AS strongest_margin
FROM numbered AS incident
LEFT JOIN rigs AS rig USING (rig_id)
LEFT JOIN recordings AS recording ON recording.recording_id = incident.recording_id
GROUP BY incident.measurement_id, incident.kind, incident.attacked, run
ORDER BY name, from_ns, incident.kind, incident.attacked

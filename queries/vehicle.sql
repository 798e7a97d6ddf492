-- What happened to a vehicle between two times: its recordings, incidents, what was not audited, and changed calibrations, in their order.
--
-- param vehicle VARCHAR: The vehicle's name, as auditor query summary shows it.
-- param since TIME = NULL: Only what ends then or later: a time such as 2026-01-05T18:40:00 (UTC), or a stamp in nanoseconds.
-- param until TIME = NULL: Only what begins then or before: a time or a stamp.
--
-- column from_utc: When it began, where the recording's clock is UTC.
-- column from_ns: Stamp at which it began.
-- column seconds: How long it took.
-- column what: recorded, incident, not audited, or calibration changed.
-- column note: What was found, why something was not audited, or which sensors a rig has.
-- column evidence: Of an incident, what exceeded its threshold, in words.
-- column latitude_deg: Where the vehicle was when it began, by GPS.
-- column longitude_deg: Where the vehicle was when it began, by GPS.
-- column frames: How many frames it has.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
WITH mine AS (
    SELECT * FROM measurements WHERE vehicle = $vehicle
),
found AS (
    SELECT
        first_stamp_ns AS from_ns,
        last_stamp_ns AS to_ns,
        'recorded' AS what,
        CASE
            WHEN judgement_id IS NULL THEN format('{} frames, not judged', measured)
            ELSE format(
                '{} frames: {} clean, {} attacked, {} unidentified, {} suspect, {} not auditable',
                measured, clean, attacked, unidentified, suspect, not_auditable
            )
        END AS note,
        measured AS frames,
        measurement_id
    FROM summary
    JOIN (SELECT measurement_id, first_stamp_ns, last_stamp_ns FROM mine) USING (measurement_id)
    UNION ALL BY NAME
    SELECT from_ns, to_ns, 'incident' AS what, finding_in_words(kind, attacked_names) AS note, evidence, frames, first_frame, measurement_id
    FROM incidents
    WHERE vehicle = $vehicle
    UNION ALL BY NAME
    SELECT
        from_ns,
        to_ns,
        'not audited' AS what,
        reason || CASE WHEN sensor IS NULL THEN '' ELSE ' (S_' || sensor || ')' END AS note,
        frames,
        first_frame,
        measurement_id
    FROM unaudited
    WHERE vehicle = $vehicle AND frames IS NOT NULL
    UNION ALL BY NAME
    SELECT stamp_ns AS from_ns, stamp_ns AS to_ns, 'calibration changed' AS what, 'frames from here on have another rig' AS note, frame AS first_frame, measurement_id
    FROM frame_steps
    WHERE recalibrated
)
SELECT
    utc_of(found.from_ns, mine.clock) AS from_utc,
    found.from_ns,
    (found.to_ns - found.from_ns) / 1e9 AS seconds,
    found.what,
    found.note,
    found.evidence,
    round(place.latitude_deg, 6) AS latitude_deg,
    round(place.longitude_deg, 6) AS longitude_deg,
    found.frames,
    mine.name,
    mine.recording_id
FROM found
JOIN mine USING (measurement_id)
LEFT JOIN places AS place
    ON place.measurement_id = found.measurement_id
        AND place.frame = coalesce(found.first_frame, (SELECT min(frame) FROM places AS first WHERE first.measurement_id = found.measurement_id))
WHERE ($since IS NULL OR found.to_ns >= $since) AND ($until IS NULL OR found.from_ns <= $until)
ORDER BY found.from_ns, found.to_ns DESC, found.what, found.note, mine.name

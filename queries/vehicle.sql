-- What happened to a vehicle between two times: its recordings, incidents, what was not audited, and changed calibrations, in their order.
--
-- param vehicle VARCHAR: The vehicle's name, as auditor query summary shows it.
-- param since TIME = NULL: Only what ends then or later: a time such as 2026-01-05T18:40:00 (UTC), or a stamp in nanoseconds.
-- param until TIME = NULL: Only what begins then or before: a time or a stamp.
--
-- column from_utc: When it began, where the recording's clock is UTC.
-- column seconds: How long it took.
-- column what: recorded, incident, not audited, or calibration changed.
-- column found: What was found, why something was not audited, or which sensors a rig has.
-- column place: Where the vehicle was when it began: latitude and longitude in degrees, by GPS.
-- column frames: How many frames it has.
-- column from_ns: Stamp at which it began.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
WITH mine AS (
    SELECT * FROM measurements WHERE vehicle = $vehicle
),
found AS (
    SELECT
        mine.first_stamp_ns AS from_ns,
        mine.last_stamp_ns AS to_ns,
        'recorded' AS what,
        CASE
            WHEN judgement.judgement_id IS NULL THEN format('{} frames, not judged', mine.measured)
            ELSE mine.measured || ' frames: ' || concat_ws(
                ', ',
                nullif(judgement.clean, 0) || ' clean',
                nullif(judgement.attacked, 0) || ' attacked',
                nullif(judgement.unidentified, 0) || ' unidentified',
                nullif(judgement.suspect, 0) || ' suspect',
                nullif(judgement.not_auditable, 0) || ' not auditable'
            )
        END AS found,
        mine.measured AS frames,
        mine.measurement_id
    FROM mine
    LEFT JOIN judgements AS judgement ON judgement.measurement_id = mine.measurement_id AND judgement.current
    UNION ALL BY NAME
    SELECT from_ns, to_ns, grade AS what, finding_in_words(kind, attacked_names) AS found, frames, first_frame, measurement_id
    FROM incidents
    WHERE vehicle = $vehicle AND same_as IS NULL
    UNION ALL BY NAME
    SELECT
        from_ns,
        to_ns,
        'not audited' AS what,
        reason || CASE WHEN sensor IS NULL THEN '' ELSE ' (S_' || sensor || ')' END AS found,
        frames,
        first_frame,
        measurement_id
    FROM unaudited
    WHERE vehicle = $vehicle AND frames IS NOT NULL
    UNION ALL BY NAME
    SELECT stamp_ns AS from_ns, stamp_ns AS to_ns, 'calibration changed' AS what, 'frames from here on have another rig' AS found, frame AS first_frame, measurement_id
    FROM frame_steps
    WHERE recalibrated
)
SELECT
    utc_of(found.from_ns, mine.clock) AS from_utc,
    (found.to_ns - found.from_ns) / 1e9 AS seconds,
    found.what,
    found.found,
    format('{:.6f}, {:.6f}', place.latitude_deg, place.longitude_deg) AS place,
    found.frames,
    mine.name,
    found.from_ns,
    mine.recording_id
FROM found
JOIN mine USING (measurement_id)
LEFT JOIN places AS place
    ON place.measurement_id = found.measurement_id
        AND place.frame = coalesce(found.first_frame, (SELECT min(frame) FROM places AS first WHERE first.measurement_id = found.measurement_id))
WHERE ($since IS NULL OR found.to_ns >= $since) AND ($until IS NULL OR found.from_ns <= $until)
ORDER BY found.from_ns, found.to_ns DESC, found.what, found.found, mine.name

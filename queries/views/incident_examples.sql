-- The frames that show an incident: the one before it, its strongest, the one after it, and the nearest clean one. At full resolution their pictures are kept where the recording was at hand when it was judged.
--
-- Where the incident's own recording has no frame before or after it, or no clean one, that of another recording of its
-- drive stands for it, with the same rig and matcher.
--
-- column incident_id: The incident, as in `incidents`.
-- column example: before, strongest, after, or clean: what the frame is to the incident.
-- column measurement_id: The measurement that the frame is of.
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
WITH wanted AS (
    SELECT
        incident_id,
        drive_id,
        parts[1].measurement_id AS first_id,
        CAST(first_frame AS BIGINT) AS first_frame,
        from_ns,
        parts[-1].measurement_id AS last_id,
        CAST(last_frame AS BIGINT) AS last_frame,
        to_ns,
        coalesce(strongest_measurement_id, measurement_id) AS strongest_id,
        CAST(coalesce(strongest_frame, first_frame) AS BIGINT) AS strongest
    FROM incidents
),
judged AS (
    SELECT
        measurement_id,
        CAST(frame AS BIGINT) AS frame,
        stamp_ns,
        kind = 'clean' AND finding IS NULL AS clean
    FROM verdicts
    WHERE measurement_id IN (SELECT unnest([first_id, last_id, strongest_id]) FROM wanted)
),
at_its_strongest AS (
    SELECT incident_id, strongest_id, strongest, judged.stamp_ns
    FROM wanted
    JOIN judged ON judged.measurement_id = wanted.strongest_id AND judged.frame = wanted.strongest
),
near AS (
    SELECT incident_id, 'before' AS example, first_id AS measurement_id, judged.frame, judged.stamp_ns, 0 AS away
    FROM wanted
    ASOF JOIN judged ON judged.measurement_id = wanted.first_id AND wanted.first_frame > judged.frame
    UNION ALL
    SELECT incident_id, 'strongest', strongest_id, strongest, stamp_ns, 0
    FROM at_its_strongest
    UNION ALL
    SELECT incident_id, 'after', last_id, judged.frame, judged.stamp_ns, 0
    FROM wanted
    ASOF JOIN judged ON judged.measurement_id = wanted.last_id AND wanted.last_frame < judged.frame
    UNION ALL
    SELECT incident_id, 'clean', strongest_id, judged.frame, judged.stamp_ns, strongest - judged.frame
    FROM wanted
    ASOF JOIN (FROM judged WHERE clean) AS judged
        ON judged.measurement_id = wanted.strongest_id AND wanted.strongest >= judged.frame
    UNION ALL
    SELECT incident_id, 'clean', strongest_id, judged.frame, judged.stamp_ns, judged.frame - strongest
    FROM wanted
    ASOF JOIN (FROM judged WHERE clean) AS judged
        ON judged.measurement_id = wanted.strongest_id AND wanted.strongest <= judged.frame
),
lacking AS (
    SELECT incident_id, example
    FROM (SELECT incident_id, unnest(['before', 'after', 'clean']) AS example FROM wanted)
    ANTI JOIN near USING (incident_id, example)
),
-- The other measurements of the drive: where a clock is relative, its stamps do not say what comes before and after.
beside AS (
    SELECT lacking.incident_id, lacking.example, other.measurement_id
    FROM lacking
    JOIN wanted USING (incident_id)
    JOIN measurements AS own ON own.measurement_id = wanted.strongest_id
    JOIN recordings AS recording ON recording.drive_id = wanted.drive_id
    JOIN measurements AS other
        ON other.recording_id = recording.recording_id AND other.rig_id = own.rig_id AND other.matcher = own.matcher
    WHERE other.recording_id <> own.recording_id AND (lacking.example = 'clean' OR recording.clock <> 'relative')
),
elsewhere AS (
    SELECT
        incident_id,
        beside.example,
        beside.measurement_id,
        CAST(verdicts.frame AS BIGINT) AS frame,
        verdicts.stamp_ns,
        CASE beside.example
            WHEN 'before' THEN wanted.from_ns - verdicts.stamp_ns
            WHEN 'after' THEN verdicts.stamp_ns - wanted.to_ns
            ELSE abs(verdicts.stamp_ns - at_its_strongest.stamp_ns)
        END AS away
    FROM beside
    JOIN wanted USING (incident_id)
    JOIN at_its_strongest USING (incident_id)
    JOIN verdicts
        ON verdicts.measurement_id = beside.measurement_id
            AND verdicts.measurement_id IN (SELECT measurement_id FROM beside)
    WHERE CASE beside.example
        WHEN 'before' THEN verdicts.stamp_ns < wanted.from_ns
        WHEN 'after' THEN verdicts.stamp_ns > wanted.to_ns
        ELSE verdicts.kind = 'clean' AND verdicts.finding IS NULL
    END
)
SELECT incident_id, example, measurement_id, frame, stamp_ns
FROM (FROM near UNION ALL FROM elsewhere)
QUALIFY row_number() OVER (PARTITION BY incident_id, example ORDER BY away, frame, measurement_id) = 1

-- The frames that show an incident: the one before it, its strongest, the one after it, and the nearest clean one. At full resolution their pictures are kept where the recording was at hand when it was judged.
--
-- column incident_id: The incident, as in `incidents`.
-- column example: before, strongest, after, or clean: what the frame is to the incident.
-- column measurement_id: The measurement that it is of: that of the strongest frame, also of the others.
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
WITH incident AS (
    SELECT
        incident_id,
        coalesce(strongest_measurement_id, measurement_id) AS measurement_id,
        CAST(coalesce(strongest_frame, first_frame) AS BIGINT) AS strongest,
        [part FOR part IN parts IF part.measurement_id = coalesce(strongest_measurement_id, incidents.measurement_id)][1]
            AS part
    FROM incidents
),
wanted AS (
    SELECT
        incident_id,
        measurement_id,
        strongest,
        CAST(part.first_frame AS BIGINT) AS first_frame,
        CAST(part.last_frame AS BIGINT) AS last_frame
    FROM incident
),
judged AS (
    SELECT
        measurement_id,
        CAST(frame AS BIGINT) AS frame,
        stamp_ns,
        kind = 'clean' AND finding IS NULL AS clean
    FROM verdicts
    WHERE measurement_id IN (SELECT measurement_id FROM wanted)
),
clean_near AS (
    SELECT incident_id, wanted.measurement_id, strongest, judged.frame, judged.stamp_ns
    FROM wanted
    ASOF JOIN (FROM judged WHERE clean) AS judged
        ON judged.measurement_id = wanted.measurement_id AND wanted.strongest >= judged.frame
    UNION ALL
    SELECT incident_id, wanted.measurement_id, strongest, judged.frame, judged.stamp_ns
    FROM wanted
    ASOF JOIN (FROM judged WHERE clean) AS judged
        ON judged.measurement_id = wanted.measurement_id AND wanted.strongest <= judged.frame
)
SELECT incident_id, 'before' AS example, wanted.measurement_id, judged.frame, judged.stamp_ns
FROM wanted
ASOF JOIN judged ON judged.measurement_id = wanted.measurement_id AND wanted.first_frame > judged.frame
UNION ALL
SELECT incident_id, 'strongest', wanted.measurement_id, judged.frame, judged.stamp_ns
FROM wanted
JOIN judged ON judged.measurement_id = wanted.measurement_id AND judged.frame = wanted.strongest
UNION ALL
SELECT incident_id, 'after', wanted.measurement_id, judged.frame, judged.stamp_ns
FROM wanted
ASOF JOIN judged ON judged.measurement_id = wanted.measurement_id AND wanted.last_frame < judged.frame
UNION ALL
SELECT incident_id, 'clean', measurement_id, frame, stamp_ns
FROM clean_near
QUALIFY row_number() OVER (PARTITION BY incident_id ORDER BY abs(frame - strongest), frame) = 1

-- The names that an incident of the view `incidents` may have had: it is named after its first frame, which another judgement or measurement may put elsewhere.
--
-- Each of its frames gives a name, and so does each frame of the two seconds before it; under which it was reviewed is one
-- as well. A name that is another incident's own leads to that one.
--
-- column name: What the incident may have been called; its own name is one of them.
-- column incident_id: The incident, as in `incidents`.
WITH incident AS MATERIALIZED (
    SELECT incident_id, parts FROM incidents
),
part AS (
    SELECT incident_id, unnest(parts) AS part FROM incident
),
framed AS (
    SELECT
        part.incident_id,
        verdicts.rig_id,
        measurements.matcher,
        verdicts.stamp_ns,
        greatest(part.part.from_ns - verdicts.stamp_ns, 0) AS away,
        -- of recordings that this one holds every frame of as well
        unnest(list_concat([verdicts.recording_id], coalesce(held.recordings, []))) AS recording_id
    FROM part
    JOIN verdicts
        ON verdicts.measurement_id = part.part.measurement_id
            AND verdicts.stamp_ns BETWEEN part.part.from_ns - 2_000_000_000 AND part.part.to_ns
    JOIN measurements ON measurements.measurement_id = verdicts.measurement_id
    LEFT JOIN (SELECT superseded_by, list(recording_id) AS recordings FROM superseded GROUP BY ALL) AS held
        ON held.superseded_by = verdicts.recording_id
),
named AS (
    SELECT incident_id AS name, incident_id, -2 AS away FROM incident
    UNION ALL
    SELECT reviewed_as, incident_id, -1 FROM incident_reviews
    UNION ALL
    SELECT name_of_incident(recording_id, rig_id, matcher, stamp_ns), incident_id, away FROM framed
)
SELECT name, incident_id
FROM named
QUALIFY row_number() OVER (PARTITION BY name ORDER BY away, incident_id) = 1

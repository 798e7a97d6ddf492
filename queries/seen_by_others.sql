-- Did others see the same at that place and time? Each incident with the other vehicles that passed, and what was found there in their recordings.
--
-- It needs GPS fixes of both, and clocks that are UTC. An incident that nobody else passed has one row without another
-- vehicle, and one without a place says so.
--
-- param metres DOUBLE = 50: How near to the place of the incident's strongest frame others have to come, in metres.
-- param seconds DOUBLE = 600: How long before or after the incident others may pass, in seconds.
-- param recording VARCHAR = NULL: Only incidents of the recording of this name, or whose id begins so.
--
-- column incident_id: The incident, as in `incidents`.
-- column name: The first recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The vehicle.
-- column found: What was found: the attacked sensors by their names, or the kind of the incident.
-- column from_utc: When it began, where the recording's clock is UTC.
-- column first_frame: Number of the first frame, within the first recording.
-- column other_vehicle: The other vehicle that passed.
-- column other_name: Its recording; text from outside, to be escaped wherever it is shown.
-- column there: What was found of the other one there, in words, or why nothing can be said.
-- column nearest_m: How near it came.
-- column after_s: How long after the incident's beginning it was nearest; before it where negative.
-- column frames: Its measured frames within that distance and time.
-- column attacked: Those of them that belong to an incident with attacked sensors.
-- column other_findings: Those of them that belong to another incident.
-- column first_other_frame: Number of the first of its frames there.
WITH incident AS (
    SELECT
        incidents.*,
        place.latitude_deg,
        place.longitude_deg,
        place.latitude_deg - $metres / 111_000 AS south_deg,
        place.latitude_deg + $metres / 111_000 AS north_deg
    FROM incidents
    LEFT JOIN places AS place
        ON place.measurement_id = incidents.strongest_measurement_id AND place.frame = incidents.strongest_frame
    WHERE $recording IS NULL OR incidents.name = $recording OR starts_with(incidents.recording_id, $recording)
),
passed AS (
    SELECT
        incident.incident_id,
        other.*,
        metres_apart(incident.latitude_deg, incident.longitude_deg, other.latitude_deg, other.longitude_deg) AS apart_m,
        (other.stamp_ns - incident.from_ns) / 1e9 AS after_s
    FROM incident
    JOIN places AS other
        ON other.stamp_ns BETWEEN incident.from_ns - CAST($seconds * 1e9 AS BIGINT) AND incident.to_ns + CAST($seconds * 1e9 AS BIGINT)
            -- degrees of latitude first: they are cheap to compare
            AND other.latitude_deg BETWEEN incident.south_deg AND incident.north_deg
    JOIN measurements AS measurement ON measurement.measurement_id = other.measurement_id AND measurement.clock = 'utc'
    WHERE incident.from_utc IS NOT NULL
        AND CASE
            WHEN other.vehicle IS NULL OR incident.vehicle IS NULL THEN other.recording_id <> incident.recording_id
            ELSE other.vehicle <> incident.vehicle
        END
),
other AS (
    SELECT
        passed.incident_id,
        passed.measurement_id,
        any_value(passed.name) AS other_name,
        any_value(passed.vehicle) AS other_vehicle,
        min(passed.apart_m) AS nearest_m,
        arg_min(passed.after_s, {apart: passed.apart_m, time: abs(passed.after_s)}) AS after_s,
        count(*) AS frames,
        count(*) FILTER (finding.kind = 'attacked') AS attacked,
        count(*) FILTER (finding.kind <> 'attacked') AS other_findings,
        count(*) FILTER (verdict.kind IS NULL) AS unjudged,
        min(passed.frame) AS first_other_frame,
        list_sort(list_distinct(flatten(list(finding.attacked) FILTER (finding.kind = 'attacked')))) AS sensors
    FROM passed
    LEFT JOIN verdicts AS verdict USING (measurement_id, frame)
    LEFT JOIN findings AS finding USING (measurement_id, frame)
    WHERE passed.apart_m <= $metres
    GROUP BY passed.incident_id, passed.measurement_id
)
SELECT
    incident.name,
    incident.vehicle,
    finding_in_words(incident.kind, incident.attacked_names) AS found,
    incident.from_utc,
    incident.first_frame,
    other.other_vehicle,
    other.other_name,
    CASE
        WHEN incident.latitude_deg IS NULL THEN 'the incident has no place: no GPS fix'
        WHEN incident.from_utc IS NULL THEN 'its clock is not UTC: times of others cannot be compared'
        WHEN other.incident_id IS NULL THEN 'nobody else passed'
        WHEN other.attacked > 0 THEN 'attacked, too: ' || array_to_string(names_of(other.sensors, rig.sensors), ' and ')
        WHEN other.other_findings > 0 THEN 'found something, too, and named no sensor'
        WHEN other.unjudged = other.frames THEN 'passed, and was not judged'
        ELSE 'passed and found nothing'
    END AS there,
    other.nearest_m,
    other.after_s,
    other.frames,
    other.attacked,
    other.other_findings,
    other.first_other_frame,
    incident.incident_id
FROM incident
LEFT JOIN other USING (incident_id)
LEFT JOIN measurements AS measurement ON measurement.measurement_id = other.measurement_id
LEFT JOIN rigs AS rig ON rig.rig_id = measurement.rig_id
ORDER BY incident.from_ns, incident.name, incident.first_frame, incident.incident_id, other.nearest_m, other.other_name

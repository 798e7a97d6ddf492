-- What a store holds: one row a recording, also those that count no longer because another holds every frame of them.
--
-- column name: The first name that it was read under; text from outside, to be escaped wherever it is shown.
-- column other_names: Further names that its content was read under.
-- column paths: Every path that its content was read from, in order.
-- column frames: Measured frames, by the latest measurement of each of its rigs.
-- column clean: Frames that are clean, by the current judgement of these, as the next four columns.
-- column found: Frames that belong to an incident or an alert.
-- column incidents: Incidents and alerts, by the current judgements; null where nothing was judged.
-- column superseded_by: The recording that holds every frame of this one.
-- column conflicts: Recordings with other data at the same stamps of the same sensors.
WITH latest AS (
    SELECT * FROM stored_measurements
    QUALIFY row_number() OVER (PARTITION BY recording_id, rig_id ORDER BY measured_at DESC, measurement_id) = 1
),
counted AS (
    SELECT
        latest.recording_id,
        count(*) AS measurements,
        sum(latest.measured)::BIGINT AS frames,
        sum(judgement.clean)::BIGINT AS clean,
        sum(judgement.attacked)::BIGINT AS attacked,
        sum(judgement.unidentified)::BIGINT AS unidentified,
        sum(judgement.suspect)::BIGINT AS suspect,
        sum(judgement.not_auditable)::BIGINT AS not_auditable,
        sum(judgement.in_incidents + coalesce(judgement.in_alerts, 0))::BIGINT AS found
    FROM latest
    LEFT JOIN judgements AS judgement ON judgement.measurement_id = latest.measurement_id AND judgement.current
    GROUP BY latest.recording_id
),
of_recording AS (
    -- Of an incident that runs through several recordings of a drive each has one.
    SELECT latest.recording_id, count(DISTINCT incident_id) AS incidents
    FROM incident_frames
    JOIN latest USING (measurement_id)
    GROUP BY latest.recording_id
)
SELECT
    recording.name,
    recording.recording_id,
    recording.vehicle,
    recording.date,
    counted.frames,
    counted.clean,
    counted.attacked,
    counted.unidentified,
    counted.suspect,
    counted.not_auditable,
    counted.found,
    CASE WHEN counted.found IS NOT NULL THEN coalesce(of_recording.incidents, 0) END AS incidents,
    recording.superseded_by,
    coalesce(recording.conflicts, []) AS conflicts,
    recording.size_bytes,
    list_filter(list_distinct([one.name FOR one IN recording.sightings]), lambda x: x <> recording.name) AS other_names,
    coalesce([one.path FOR one IN recording.sightings], [recording.path]) AS paths
FROM stored_recordings AS recording
LEFT JOIN counted USING (recording_id)
LEFT JOIN of_recording USING (recording_id)
ORDER BY recording.name, recording.recording_id

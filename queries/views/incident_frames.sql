-- One row a frame of an incident of the view `incidents`: what joins incidents to verdicts, regions and pictures.
--
-- column incident_id: The incident, as in `incidents`.
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: attacked, unidentified or suspect, of the incident.
-- column attacked: The attacked sensors of the incident; empty unless kind is attacked.
SELECT
    incident.incident_id,
    finding.recording_id,
    finding.measurement_id,
    finding.judgement_id,
    finding.frame,
    finding.stamp_ns,
    finding.kind,
    finding.attacked,
    finding.gap
FROM (SELECT incident_id, grade, kind, attacked, unnest(parts) AS part FROM incidents) AS incident
JOIN findings AS finding
    -- of one kind and one set of sensors, incidents do not overlap
    ON finding.measurement_id = incident.part.measurement_id
        AND finding.kind = incident.kind
        AND finding.attacked = incident.attacked
        AND finding.alert = (incident.grade = 'alert')
        AND finding.frame BETWEEN incident.part.first_frame AND incident.part.last_frame

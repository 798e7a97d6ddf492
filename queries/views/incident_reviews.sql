-- One row a review of an incident of the view `incidents`, the whole history; the last of an incident counts while it is in effect.
--
-- column incident_id: The incident, as in `incidents`.
-- column places: The recordings in which it counts, as in `reviews`.
-- column reviewed_as: The incident as it was called when it was reviewed.
-- column in_effect: TRUE until the last day on which it counts, by this machine's clock.
-- column counts: TRUE where it is the last one of the incident, and in effect.
SELECT
    incident.incident_id,
    review.* EXCLUDE (incident_id),
    review.incident_id AS reviewed_as,
    review.in_effect AND row_number() OVER (
        PARTITION BY incident.incident_id ORDER BY review.reviewed_at DESC, review.review_id DESC
    ) = 1 AS counts
FROM incidents AS incident
JOIN reviews AS review ON is_one_incident(
    list_concat([part.recording_id FOR part IN incident.parts], [incident.drive_id]),
    incident.attacked_names, incident.from_ns, incident.to_ns,
    review.places, review.sensors, review.from_ns, review.to_ns
)

-- What somebody said of incidents (auditor review), the whole history, and which reviews count.
--
-- column incident: The incident that it is of now; as it was called then, where there is none now.
-- column recording: The first recording's name; text from outside, to be escaped wherever it is shown.
-- column sensors: The attacked sensors; empty where none was named.
-- column said: confirmed, false-alarm or known.
-- column until: The last day (UTC) on which it counts, or 'for good'.
-- column by: The user who reviewed.
-- column at: When it was reviewed.
-- column counts: Whether it counts, or why not.
SELECT
    coalesce(found.incident_id, review.incident_id) AS incident,
    review.name AS recording,
    array_to_string(review.sensors, ' + ') AS sensors,
    review.verdict AS said,
    review.reason,
    coalesce(CAST(review.until AS VARCHAR), 'for good') AS until,
    review.author AS by,
    review.reviewed_at AS at,
    CASE
        WHEN found.counts THEN 'yes'
        WHEN found.incident_id IS NULL THEN 'no: no such incident now'
        WHEN NOT review.in_effect THEN 'no: its last day is over'
        ELSE 'no: a later one does'
    END AS counts,
    review.review_id
FROM reviews AS review
LEFT JOIN incident_reviews AS found USING (review_id)
ORDER BY review.reviewed_at, review.review_id, incident

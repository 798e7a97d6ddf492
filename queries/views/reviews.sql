-- One row a review that somebody made with auditor review: the whole history.
--
-- column places: The recordings in which it counts: those of the incident, the one that their drive began with, and those that hold every frame of one of them.
-- column in_effect: TRUE until the last day on which it counts, by this machine's clock. A later review of the incident counts in its place.
SELECT
    review.*,
    list_distinct(list_concat(review.recordings, [review.drive_id], coalesce(later.ids, []))) AS places,
    review.until IS NULL OR review.until >= CAST(timezone('UTC', now()) AS DATE) AS in_effect
FROM stored_reviews AS review
LEFT JOIN (
    SELECT review_id, list(superseded.superseded_by) AS ids
    FROM (SELECT review_id, unnest(recordings) AS recording_id FROM stored_reviews)
    JOIN superseded USING (recording_id)
    GROUP BY review_id
) AS later USING (review_id)

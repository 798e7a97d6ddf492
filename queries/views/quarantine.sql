-- One row a recording that a refresh left out and that a person should look at.
--
-- column labelled: What was said of it since: clean or attacked; NULL where nobody has looked at it yet.
SELECT
    *,
    (
        SELECT CASE WHEN bool_or(attack IS NOT NULL) THEN 'attacked' WHEN count(*) > 0 THEN 'clean' END
        FROM stored_given_labels AS label
        WHERE label.recording_id = stored_quarantine.recording_id
    ) AS labelled
FROM stored_quarantine

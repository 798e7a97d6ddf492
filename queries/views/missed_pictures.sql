-- One row a case of an evaluation that was missed and is shown on its page: a picture of what was attacked.
--
-- column experiment: What was tried: combinations, sensitivity, further, intervals or patterns.
-- column recording_id: The recording, taken to be clean.
SELECT
    picture.*,
    evaluations.experiment,
    evaluations.recording_id
FROM stored_missed_pictures AS picture
JOIN evaluations USING (evaluation_id)

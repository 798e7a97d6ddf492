-- One row a case of an evaluation: a clean frame, or one that was attacked in memory.
--
-- column setup: What its counts may be pooled with: made alike, on one rig kind, of real or of synthetic drives.
-- column experiment: What was tried: clean, combinations, sensitivity, further, intervals or patterns.
-- column recording_id: The recording, taken to be clean.
-- column rig_id: The rig.
SELECT
    stored_cases.*,
    evaluations.setup,
    evaluations.experiment,
    evaluations.recording_id,
    evaluations.rig_id
FROM stored_cases
JOIN evaluations USING (evaluation_id)

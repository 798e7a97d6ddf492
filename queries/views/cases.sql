-- One row a case of an evaluation: a clean frame, or one that was attacked in memory.
--
-- column setup: What its counts may be pooled with: made alike, on one rig kind, of real or of synthetic drives.
-- column experiment: What was tried: clean, combinations, sensitivity, further, intervals, unseen or patterns.
-- column recording_id: The recording, taken to be clean.
-- column rig_id: The rig.
-- column family: What the recording is alike with: a street's style and condition; else the recording's id.
SELECT
    stored_cases.*,
    evaluations.setup,
    evaluations.experiment,
    evaluations.recording_id,
    evaluations.rig_id,
    coalesce(evaluations.family, evaluations.recording_id) AS family
FROM stored_cases
JOIN evaluations USING (evaluation_id)

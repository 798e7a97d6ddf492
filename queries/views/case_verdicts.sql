-- One row a case of an evaluation, system and way of calibrating: the verdict of a scan at r = 1 %.
--
-- column setup: What it was calibrated with: made alike, on one rig kind, of real or of synthetic drives.
-- column experiment: What was tried: clean, combinations, sensitivity, further, intervals, unseen or patterns.
-- column recording_id: The recording, taken to be clean.
-- column rig_id: The rig.
SELECT
    judged.*,
    evaluations.setup,
    evaluations.experiment,
    evaluations.recording_id,
    evaluations.rig_id
FROM stored_case_verdicts AS judged
JOIN evaluations USING (evaluation_id)

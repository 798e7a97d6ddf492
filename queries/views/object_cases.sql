-- One row a case of the object-level baseline: the objects of a clean frame, or of one that was attacked in memory.
--
-- column setup: What it belongs to: the setup of evaluations that were made alike, on one rig kind, of real or of synthetic drives.
-- column detector: What found the objects: geometric, or the files of the networks; text from outside.
-- column detector_id: What its objects may be pooled with: the same networks with the same descriptions.
-- column experiment: What was tried: clean, combinations or sensitivity.
-- column recording_id: The recording, taken to be clean.
-- column rig_id: The rig.
SELECT
    stored_object_cases.*,
    object_evaluations.setup,
    object_evaluations.detector,
    object_evaluations.detector_id,
    object_evaluations.experiment,
    object_evaluations.recording_id,
    object_evaluations.rig_id
FROM stored_object_cases
JOIN object_evaluations USING (evaluation_id)

-- One row a frame with its verdict by the current judgement, and the recording that it is of.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    verdict.*,
    measurement.recording_id,
    measurement.rig_id,
    recording.name,
    recording.vehicle,
    judgement.method
FROM stored_verdicts AS verdict
JOIN judgements AS judgement ON judgement.judgement_id = verdict.judgement_id AND judgement.current
JOIN stored_measurements AS measurement ON measurement.measurement_id = verdict.measurement_id
LEFT JOIN stored_recordings AS recording USING (recording_id)
WHERE measurement.recording_id NOT IN (SELECT recording_id FROM superseded)

-- One row a finished measurement, with its recording's name.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column clock: What the stamps count from: utc, relative or unknown.
-- column kind: The rig kind in words.
SELECT
    measurement.*,
    recording.name,
    recording.vehicle,
    recording.clock,
    rig.kind
FROM stored_measurements AS measurement
ANTI JOIN superseded USING (recording_id)
LEFT JOIN stored_recordings AS recording USING (recording_id)
LEFT JOIN rigs AS rig USING (rig_id)

-- One row a measured frame and topic that says where the vehicle was: the pose nearest to the frame in time.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column topic: The topic of GPS fixes, odometry, poses or transforms.
-- column schema: The type of its messages.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    pose.*,
    measurement.recording_id,
    recording.name,
    recording.vehicle
FROM stored_poses AS pose
JOIN stored_measurements AS measurement USING (measurement_id)
ANTI JOIN superseded ON superseded.recording_id = measurement.recording_id
LEFT JOIN stored_recordings AS recording ON recording.recording_id = measurement.recording_id

-- One row a measured frame with a GPS fix: where the vehicle was, by the fix nearest in time.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column topic: The topic of the fix; of several equally near the first by name.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    measurement_id,
    recording_id,
    name,
    vehicle,
    frame,
    stamp_ns,
    latitude_deg,
    longitude_deg,
    altitude_m,
    offset_ns,
    topic
FROM poses
WHERE latitude_deg IS NOT NULL
QUALIFY row_number() OVER (PARTITION BY measurement_id, frame ORDER BY abs(offset_ns), topic, frame_id) = 1

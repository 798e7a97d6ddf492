-- One row a frame so strong that it is told by itself, and that belongs to no incident: nothing before or after it says the same.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: attacked, unidentified or suspect.
-- column attacked: The attacked sensors; empty unless kind is attacked.
-- column evidence: What exceeded its threshold and how far, the strongest first.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    name,
    vehicle,
    recording_id,
    measurement_id,
    judgement_id,
    frame,
    stamp_ns,
    kind,
    attacked,
    gap,
    evidence,
    causes
FROM verdicts
WHERE coalesce(single_frame, false)
ORDER BY name, recording_id, stamp_ns, frame

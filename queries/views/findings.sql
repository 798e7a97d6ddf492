-- One row a frame whose verdict is a finding: attacked, unidentified or suspect. Incidents are runs of these.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: attacked, unidentified or suspect.
-- column attacked: The sensors that the verdict names; empty unless kind is attacked.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT * FROM verdicts WHERE kind IN ('attacked', 'unidentified', 'suspect')

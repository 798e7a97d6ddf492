-- One row a frame that belongs to an incident: attacked, unidentified or suspect. Incidents are runs of these.
--
-- By the paper's method these are the frames whose verdict is a finding; by the robust method those of them which the temporal
-- window around them confirms, with its verdict.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: attacked, unidentified or suspect: that of the temporal window around the frame by the robust method.
-- column attacked: The sensors that the verdict names; empty unless kind is attacked.
-- column causes: What else than an attack may lie behind it, the likeliest first, as in `verdicts`.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    * REPLACE (
        CASE WHEN method = 'robust' THEN finding ELSE kind END AS kind,
        CASE WHEN method = 'robust' THEN finding_attacked ELSE attacked END AS attacked
    )
FROM verdicts
WHERE CASE WHEN method = 'robust' THEN finding ELSE kind END IN ('attacked', 'unidentified', 'suspect')

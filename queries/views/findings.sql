-- One row a frame of an event, an incident or an alert: attacked, unidentified or suspect.
--
-- By the paper's method these are the frames whose verdict is a finding; by the robust method the frames of its events,
-- with their kind and sensors. What belongs to no event is in `verdicts` alone.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: attacked, unidentified or suspect: by the robust method that of the event.
-- column attacked: The attacked sensors; empty unless kind is attacked.
-- column alert: TRUE where its event is an alert, and no incident.
-- column own_kind: The verdict on the frame by itself; clean where it is part of an event and no finding.
-- column own_attacked: The sensors that this verdict names.
-- column causes: What else than an attack may lie behind it, the likeliest first, as in `verdicts`.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
SELECT
    * REPLACE (finding AS kind, finding_attacked AS attacked, coalesce(alert, false) AS alert),
    kind AS own_kind,
    attacked AS own_attacked
FROM verdicts
WHERE method = 'robust' -- each method by itself: what its own column leaves out is not even read
    AND finding IS NOT NULL -- this one DuckDB pushes down, row by row
    AND finding IN ('attacked', 'unidentified', 'suspect')
UNION ALL
SELECT * REPLACE (false AS alert), kind AS own_kind, attacked AS own_attacked
FROM verdicts
WHERE method <> 'robust' AND kind IN ('attacked', 'unidentified', 'suspect')

-- Which recordings wait for a person? Those that a refresh left out since they were raised, differ from the others, or are in doubt.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: Its vehicle.
-- column since: When a refresh left it out first, in UTC.
-- column reason: Why.
-- column findings: Its frames that were not clean when it was judged by others.
-- column kind: The rig kind in words.
SELECT name, vehicle, day, date_trunc('second', since) AS since, reason, findings_by_others AS findings, frames, kind, matcher, recording_id
FROM quarantine
WHERE labelled IS NULL AND ($recording IS NULL OR name = $recording OR starts_with(recording_id, $recording))
ORDER BY since DESC, kind, matcher, name, recording_id

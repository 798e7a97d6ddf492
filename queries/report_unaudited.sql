-- What the index of a fleet says of what was not audited: one row a reason, over all recordings.
--
-- column what: frames, sensor, topic, measurement, recording or input, as in the view `unaudited`.
-- column recordings: In how many recordings.
-- column frames: How many frames or ticks; NULL of what is no frame.
-- column name: One of the recordings; text from outside, to be escaped wherever it is shown.
-- column remedy: What to do about it, where that is known.
SELECT
    what,
    reason,
    count(DISTINCT coalesce(recording_id, name)) AS recordings,
    CAST(sum(frames) AS BIGINT) AS frames,
    min(name) AS name,
    any_value(remedy) AS remedy
FROM unaudited
GROUP BY what, reason
-- what was not audited at all comes before single frames
ORDER BY list_position(['input', 'recording', 'measurement', 'frames', 'sensor', 'topic'], what), frames DESC NULLS FIRST,
    recordings DESC, reason

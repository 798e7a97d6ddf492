-- One row a topic of a measurement: where its messages went.
--
-- column topic: The topic.
-- column schema: The type of its messages.
-- column sensor: The sensor whose data it carries; NULL where it is none of the rig's.
-- column read: Messages read.
-- column used: Messages that became part of a frame.
-- column unused: Messages that no frame wanted.
-- column damaged: Messages that could not be decoded whole.
-- column skipped: Messages left out, by reason.
-- column adds_up: TRUE where no message is unaccounted for.
-- column state: Of a topic of camera pictures or LiDAR points: read, unreadable or left out of the rig; else NULL.
-- column reason: Why it is unreadable or left out.
SELECT
    measurement_id,
    recording_id,
    topic.topic,
    topic.schema,
    topic.sensor,
    topic.read,
    topic.used,
    topic.unused,
    topic.damaged,
    topic.skipped,
    topic.read = topic.used + topic.unused + topic.damaged + coalesce(list_sum(map_values(topic.skipped)), 0) AS adds_up,
    [entry.state for entry in coverage if entry.topic = topic.topic][1] AS state,
    [nullif(entry.reason, '') for entry in coverage if entry.topic = topic.topic][1] AS reason
FROM (SELECT measurement_id, recording_id, coverage, unnest(balance) AS topic FROM stored_measurements ANTI JOIN superseded USING (recording_id))

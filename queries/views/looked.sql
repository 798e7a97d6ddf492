-- One row a sensor on board and measurement: what of it was looked at, by how many others.
--
-- column recording_id: The recording.
-- column sensor: Number of the sensor: 0 the LiDAR, 1..n the cameras from right to left; NULL where no rig has it.
-- column name: The recording's own name of the sensor; of one that no rig has its topic.
-- column topic: The topic that carries its data.
-- column frames: Frames in which it was there.
-- column time_share: Share of the frames in which it was there.
-- column two_share: Share of its picture, or of its points, that two others at least were compared with, of the frames in which it was there.
-- column one_share: Share that one other alone was compared with.
-- column none_share: Share that nothing was compared with.
-- column reason: Why nothing was, of a sensor that no rig has.
WITH current_measurements AS (
    SELECT * FROM stored_measurements ANTI JOIN superseded USING (recording_id)
),
of_rig AS (
    SELECT rig_id, unnest(sensors) AS entry, generate_subscripts(sensors, 1) AS position FROM stored_rigs
)
SELECT
    recording_id,
    measurement_id,
    entry.sensor AS sensor,
    entry.name AS name,
    entry.topic AS topic,
    present_frames[position] AS frames,
    present_frames[position] / measured AS time_share,
    compared_by_two_share[position] AS two_share,
    compared_share[position] - compared_by_two_share[position] AS one_share,
    1 - compared_share[position] AS none_share,
    NULL AS reason
FROM current_measurements
JOIN of_rig USING (rig_id)
UNION ALL
SELECT recording_id, measurement_id, NULL, entry.topic, entry.topic, 0, 0.0, 0.0, 0.0, 1.0, nullif(entry.reason, '')
FROM (SELECT recording_id, measurement_id, unnest(coverage) AS entry FROM current_measurements)
WHERE entry.state IN ('unreadable', 'not compared', 'left out')

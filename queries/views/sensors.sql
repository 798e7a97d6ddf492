-- One row a frame and sensor: what there was of the sensor, and how much of it could be used.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column sensor: Number of the sensor: 0 the LiDAR, 1..n the cameras from right to left.
-- column position: Place of the sensor in lists that follow the rig's sensors, counted from 1.
-- column name: The recording's own name of the sensor.
-- column topic: The topic that carries its data.
-- column state: present, missing or damaged.
-- column state_reason: Why it is missing or damaged, where that is known.
-- column skew_ns: Its stamp, less its learnt offset, minus the frame's stamp.
-- column saturated_share: Share of saturated pixels of a camera.
-- column textureless_share: Share of pixels of a camera without texture.
-- column unmatched_share: Share of pixels of a source camera without a disparity.
-- column level: Mean of a camera's pixels in grey levels.
-- column returns: LiDAR points that fall into the leftmost camera's view.
-- column compared_share: Share of a camera's picture, or of the LiDAR's points, that one other sensor at least was compared with.
-- column compared_by_two_share: The same by two other sensors at least.
SELECT
    frame.measurement_id,
    frame.frame,
    frame.stamp_ns,
    sensor.entry.sensor,
    sensor.position,
    sensor.entry.name,
    sensor.entry.topic,
    frame.state[sensor.position] AS state,
    frame.state_reason[sensor.position] AS state_reason,
    frame.skew_ns[sensor.position] AS skew_ns,
    frame.saturated_share[sensor.position] AS saturated_share,
    frame.textureless_share[sensor.position] AS textureless_share,
    frame.unmatched_share[sensor.position] AS unmatched_share,
    frame.level[sensor.position] AS level,
    frame.returns[sensor.position] AS returns,
    frame.compared_share[sensor.position] AS compared_share,
    frame.compared_by_two_share[sensor.position] AS compared_by_two_share
FROM stored_frames AS frame
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN (
    SELECT rig_id, unnest(sensors) AS entry, generate_subscripts(sensors, 1) AS position FROM stored_rigs
) AS sensor USING (rig_id)
WHERE frame.skipped IS NULL

-- How much of each sensor could be used: one row a measurement and sensor.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column sensor: Number of the sensor: 0 the LiDAR, 1..n the cameras from right to left.
-- column sensor_name: The recording's own name of the sensor.
-- column frames: Frames that were measured.
-- column present: Frames with the sensor's data.
-- column missing: Frames without it.
-- column damaged: Frames in which it could not be decoded whole.
-- column first_frame: Number of the first frame with its data: a sensor may start late.
-- column last_frame: Number of the last frame with its data.
-- column offset_ms: How far its stamps lie behind those of the leftmost camera that was seen, learnt or given.
-- column clock_jumps: How often the recording's stamps jumped back.
-- column saturated_share: Mean share of saturated pixels of a camera.
-- column textureless_share: Mean share of pixels of a camera without texture.
-- column unmatched_share: Mean share of pixels of a source camera without a disparity.
-- column returns: Mean number of LiDAR points that fall into the leftmost camera's view.
-- column fewest_returns: Smallest number of such points.
-- column largest_skew_ms: Largest distance of its stamp, less its learnt offset, from a frame's.
SELECT
    any_value(measurement.recording_id) AS recording_id,
    any_value(measurement.name) AS name,
    sensor.measurement_id,
    sensor.sensor,
    any_value(sensor.name) AS sensor_name,
    count(*) AS frames,
    count(*) FILTER (sensor.state = 'present') AS present,
    count(*) FILTER (sensor.state = 'missing') AS missing,
    count(*) FILTER (sensor.state = 'damaged') AS damaged,
    min(sensor.frame) FILTER (sensor.state = 'present') AS first_frame,
    max(sensor.frame) FILTER (sensor.state = 'present') AS last_frame,
    any_value(measurement.offsets_ns[sensor.position]) / 1e6 AS offset_ms,
    any_value(measurement.clock_jumps) AS clock_jumps,
    avg(sensor.saturated_share) AS saturated_share,
    avg(sensor.textureless_share) AS textureless_share,
    avg(sensor.unmatched_share) AS unmatched_share,
    avg(sensor.returns) AS returns,
    min(sensor.returns) AS fewest_returns,
    max(abs(sensor.skew_ns)) / 1e6 AS largest_skew_ms
FROM sensors AS sensor
JOIN measurements AS measurement USING (measurement_id)
WHERE $recording IS NULL OR measurement.name = $recording OR starts_with(measurement.recording_id, $recording)
GROUP BY sensor.measurement_id, sensor.sensor
ORDER BY name, sensor.measurement_id, sensor.sensor

-- How much of each sensor could be used: one row a measurement and sensor, and one a sensor that is in no rig.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column sensor: Number of the sensor: 0 the LiDAR, 1..n the cameras from right to left; NULL where no rig has it.
-- column sensor_name: The recording's own name of the sensor.
-- column topic: The topic that carries its data.
-- column state: read, unreadable, or left out of the rig; NULL where it was measured before that was kept.
-- column reason: Why it is unreadable or left out.
-- column remedy: What to install or convert, so that it can be read.
-- column frames: Frames that were measured.
-- column present: Frames with the sensor's data.
-- column missing: Frames without it.
-- column damaged: Frames in which it could not be decoded whole.
-- column first_frame: Number of the first frame with its data: a sensor may start late.
-- column last_frame: Number of the last frame with its data.
-- column messages: Its messages in the recording.
-- column messages_share: Share of those that count which are in a frame by their own stamp.
-- column time_share: Share of the recording's time that these cover.
-- column against: Messages that count against it, by reason: repeated stamps, late, unpaired, damaged, ...
-- column late_s: How much later than the recording it begins.
-- column early_s: How much earlier than the recording it ends.
-- column gaps: Gaps of more than a few periods.
-- column longest_gap_s: The longest of them.
-- column offset_ms: How far its stamps lie behind those of the leftmost camera that was seen, learnt or given.
-- column clock_jumps: How often the recording's stamps jumped back.
-- column saturated_share: Mean share of saturated pixels of a camera.
-- column textureless_share: Mean share of pixels of a camera without texture.
-- column unmatched_share: Mean share of pixels of a source camera without a disparity.
-- column returns: Mean number of LiDAR points that fall into the leftmost camera's view.
-- column fewest_returns: Smallest number of such points.
-- column largest_skew_ms: Largest distance of its stamp, less its learnt offset, from a frame's.
WITH chosen AS (
    SELECT *
    FROM measurements
    WHERE $recording IS NULL OR name = $recording OR starts_with(recording_id, $recording)
),
covered AS (
    SELECT measurement_id, unnest(coverage) AS topic FROM chosen
),
seen AS (
    SELECT
        measurement_id,
        sensor.sensor,
        any_value(sensor.position) AS position,
        any_value(sensor.name) AS sensor_name,
        any_value(sensor.topic) AS topic,
        count(*) AS frames,
        count(*) FILTER (sensor.state = 'present') AS present,
        count(*) FILTER (sensor.state = 'missing') AS missing,
        count(*) FILTER (sensor.state = 'damaged') AS damaged,
        min(sensor.frame) FILTER (sensor.state = 'present') AS first_frame,
        max(sensor.frame) FILTER (sensor.state = 'present') AS last_frame,
        avg(sensor.saturated_share) AS saturated_share,
        avg(sensor.textureless_share) AS textureless_share,
        avg(sensor.unmatched_share) AS unmatched_share,
        avg(sensor.returns) AS returns,
        min(sensor.returns) AS fewest_returns,
        max(abs(sensor.skew_ns)) / 1e6 AS largest_skew_ms
    FROM sensors AS sensor
    SEMI JOIN chosen USING (measurement_id)
    GROUP BY measurement_id, sensor.sensor
)
SELECT
    chosen.recording_id,
    chosen.name,
    chosen.measurement_id,
    seen.sensor,
    coalesce(seen.sensor_name, covered.topic.name) AS sensor_name,
    coalesce(seen.topic, covered.topic.topic) AS topic,
    covered.topic.state AS state,
    nullif(covered.topic.reason, '') AS reason,
    nullif(covered.topic.remedy, '') AS remedy,
    seen.frames,
    seen.present,
    seen.missing,
    seen.damaged,
    seen.first_frame,
    seen.last_frame,
    covered.topic.read AS messages,
    CASE covered.topic.state WHEN 'read' THEN covered.topic.regular / nullif(
        covered.topic.regular + coalesce(list_sum(map_values(covered.topic.against)), 0), 0
    ) END AS messages_share,
    covered.topic.covered_ns / nullif(covered.topic.held_ns, 0) AS time_share,
    covered.topic.against AS against,
    covered.topic.late_ns / 1e9 AS late_s,
    covered.topic.early_ns / 1e9 AS early_s,
    covered.topic.gaps AS gaps,
    covered.topic.longest_gap_ns / 1e9 AS longest_gap_s,
    chosen.offsets_ns[seen.position] / 1e6 AS offset_ms,
    chosen.clock_jumps,
    seen.saturated_share,
    seen.textureless_share,
    seen.unmatched_share,
    seen.returns,
    seen.fewest_returns,
    seen.largest_skew_ms
FROM seen
FULL JOIN covered ON covered.measurement_id = seen.measurement_id AND covered.topic.topic = seen.topic
JOIN chosen ON chosen.measurement_id = coalesce(seen.measurement_id, covered.measurement_id)
ORDER BY chosen.name, chosen.measurement_id, seen.sensor NULLS LAST, topic

-- What was found in each recording: one row a recording, and one for each further rig or procedure it was measured with.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column kind: The rig kind in words.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column rig_id: The rig.
-- column rig_name: The recording's own name of the rig's only camera (of its LiDAR, where it has no camera), or how many there are.
-- column judgement_id: The current judgement; NULL where nothing was judged.
-- column frames: Frames and skipped ticks, without those at the recording's edges.
-- column measured: Frames that were measured.
-- column audited_share: Share of `frames` that have a verdict other than not_auditable; NULL where nothing was judged.
-- column looked_share: Of the camera of which least is looked at: the share of its picture that two others at least were compared with, in rigs of two or three sensors with another one, or its own past; of several LiDARs without cameras the share of the points of one that another was compared with; NULL where that was not measured.
-- column lidar_share: Of the LiDAR of a rig with cameras: the share of its points that these, or one and its own past, were compared with; the others are looked at for what appears there. NULL where that was not measured.
-- column attacked_sensors: Sensors that an incident or an alert names; by the robust method a frame that belongs to neither names none, though `attacked` counts it.
-- column alerts: Frames with a finding that belong to an alert, and to no incident.
-- column attacked_names: The recording's own names of these sensors.
-- column attacked: Frames in which the attacked sensors are named.
-- column statistic: Which pixels the current judgement counted: plain or gated.
-- column r: The designated false-alarm rate of the current judgement.
-- column drives: How many clean recordings the current judgement's thresholds were learnt from, 0 where they are the prior; NULL by the paper's method.
-- column z_limit: What the largest z of a frame had to exceed; NULL by the paper's method.
-- column damage: Pieces of damage met while reading.
-- column attacked_sets: The sets of sensors that incidents and alerts name, each with its number of frames, the most frames first.
SELECT
    recording.recording_id,
    recording.name,
    recording.vehicle,
    recording.date,
    measurement.measurement_id,
    measurement.rig_id,
    judgement.judgement_id,
    rig.kind,
    CASE
        WHEN rig.n = 1 OR len(rig.sensors) = 1 THEN rig.sensors[-1].name
        WHEN rig.n = 0 THEN concat(len(rig.sensors), ' LiDARs')
        ELSE concat(rig.n, ' cameras')
    END AS rig_name,
    measurement.frames - coalesce(measurement.skipped['edge'], 0) AS frames,
    measurement.measured,
    (judgement.clean + judgement.attacked + judgement.unidentified + judgement.suspect)
        / nullif(measurement.frames - coalesce(measurement.skipped['edge'], 0), 0) AS audited_share,
    list_min(
        CASE
            WHEN len(rig.sensors) > 3 AND rig.n > 0 THEN measurement.compared_by_two_share
            ELSE measurement.compared_share
        END[if(rig.sensors[1].sensor = 0 AND (rig.n > 0 OR len(rig.sensors) = 1), 2, 1):]
    ) AS looked_share,
    CASE WHEN rig.n > 0 AND rig.sensors[1].sensor = 0 THEN measurement.compared_share[1] END AS lidar_share,
    judgement.clean,
    judgement.attacked,
    judgement.unidentified,
    judgement.suspect,
    judgement.not_auditable,
    coalesce(judgement.in_alerts, 0) AS alerts,
    coalesce(named.sensors, []) AS attacked_sensors,
    coalesce(names_of(named.sensors, rig.sensors), []) AS attacked_names,
    judgement.method,
    judgement.statistic,
    CAST(judgement.r AS DOUBLE) AS r,
    judgement.resolvable,
    judgement.drives,
    judgement.z_limit,
    judgement.transferred,
    judgement.calibration_id,
    len(recording.damage) + coalesce(len(measurement.damage), 0) AS damage,
    coalesce(named.sets, []) AS attacked_sets
FROM recordings AS recording
LEFT JOIN measurements AS measurement USING (recording_id)
LEFT JOIN rigs AS rig USING (rig_id)
LEFT JOIN judgements AS judgement
    ON judgement.measurement_id = measurement.measurement_id AND judgement.current
LEFT JOIN (
    SELECT
        measurement_id,
        list({attacked: attacked, frames: frames} ORDER BY frames DESC, attacked) AS sets,
        list_sort(list_distinct(flatten(list(attacked)))) AS sensors
    FROM (
        SELECT measurement_id, attacked, count(*) AS frames
        FROM findings WHERE kind = 'attacked'
        GROUP BY measurement_id, attacked
    )
    GROUP BY measurement_id
) AS named ON named.measurement_id = measurement.measurement_id
WHERE $recording IS NULL OR recording.name = $recording OR starts_with(recording.recording_id, $recording)
ORDER BY recording.name, recording.recording_id, measurement.measurement_id

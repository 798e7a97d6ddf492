-- One row a measured frame and pair check: the windowed ratio.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column position: Place of the pair check in `ratios`, counted from 1.
-- column check_name: Which check: lidar_conflict, photometric_inconsistency, brightness_difference, point_dropout or isolated_points.
-- column i: First camera of the pair; of point_dropout and isolated_points the LiDAR, 0.
-- column k: Second camera of the pair; of point_dropout and isolated_points the one whose view it is.
-- column ratio: The windowed ratio; NULL where it was not measured.
-- column theta: Its threshold by the current judgement; NULL where that is not of the robust method.
-- column z: Its score (ratio - theta) / scale, kept between -2 and 3.
SELECT
    frame.measurement_id,
    frame.frame,
    frame.stamp_ns,
    pair_check.position,
    pair_check.check_name,
    pair_check.i,
    pair_check.k,
    frame.ratios[pair_check.position] AS ratio,
    judgement.check_theta[pair_check.position] AS theta,
    z_score(
        frame.ratios[pair_check.position],
        judgement.check_theta[pair_check.position],
        judgement.check_scale[pair_check.position]
    ) AS z
FROM stored_frames AS frame
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN stored_pair_checks AS pair_check USING (rig_id)
LEFT JOIN judgements AS judgement ON judgement.measurement_id = frame.measurement_id AND judgement.current
WHERE frame.skipped IS NULL

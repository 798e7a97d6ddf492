-- One row a measured frame and element: the local ratio of each check_name.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column position: Place of the element in `ratios`, counted from 1.
-- column check_name: Who says something: contradicted, unlike, light, empty or scattered.
-- column i: First camera of the pair; of empty and scattered the LiDAR, 0.
-- column k: Second camera of the pair; of empty and scattered the one whose view it is.
-- column ratio: The local ratio; NULL where it was not measured.
-- column theta: Its threshold by the current judgement; NULL where that is not of the robust method.
-- column z: Its margin (ratio - theta) / scale, kept between -2 and 3.
SELECT
    frame.measurement_id,
    frame.frame,
    frame.stamp_ns,
    element.position,
    element.check_name,
    element.i,
    element.k,
    frame.ratios[element.position] AS ratio,
    judgement.check_theta[element.position] AS theta,
    margin(
        frame.ratios[element.position],
        judgement.check_theta[element.position],
        judgement.check_scale[element.position]
    ) AS z
FROM stored_frames AS frame
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN stored_pair_checks AS element USING (rig_id)
LEFT JOIN judgements AS judgement ON judgement.measurement_id = frame.measurement_id AND judgement.current
WHERE frame.skipped IS NULL

-- One row a measured frame and triple: the disparity errors, and the state that the current judgement gives them.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column position: Place of the triple in e, counted from 1; that of the fallback is the one after the last.
-- column fallback: TRUE for the triple that counts in those frames only in which no other was measured.
-- column valid_px: Pixels at which both disparity maps can be compared.
-- column inconsistent_px: Valid pixels that are inconsistent (Eq. 2).
-- column gated_valid_px: Valid pixels with texture in a camera of the triple.
-- column gated_inconsistent_px: Inconsistent pixels with texture in a camera of the triple.
-- column out_of_range_px: Valid LiDAR pixels nearer than the matcher can see.
-- column E_plain: The disparity error E of all valid pixels; NULL where it was not measured.
-- column E_gated: The disparity error E of the valid pixels with texture; NULL where it was not measured.
-- column statistic: Which of the two the current judgement looked at.
-- column theta: Its threshold.
-- column e: '1' where E > theta, '0' where not, '-' where either is NULL; NULL where nothing was judged, and of the fallback where another triple was measured.
SELECT
    * EXCLUDE (judged, needless),
    CASE
        WHEN judged AND NOT needless THEN coalesce(
            CAST(CAST(CASE statistic WHEN 'gated' THEN E_gated ELSE E_plain END > theta AS INTEGER) AS VARCHAR), '-'
        )
    END AS e
FROM (
    SELECT
        frame.measurement_id,
        frame.frame,
        frame.stamp_ns,
        triple.position,
        triple.i,
        triple.j,
        triple.k,
        coalesce(triple.fallback, FALSE) AS fallback,
        frame.valid_px[triple.position] AS valid_px,
        frame.inconsistent_px[triple.position] AS inconsistent_px,
        frame.gated_valid_px[triple.position] AS gated_valid_px,
        frame.gated_inconsistent_px[triple.position] AS gated_inconsistent_px,
        frame.out_of_range_px[triple.position] AS out_of_range_px,
        disparity_error(frame.inconsistent_px[triple.position], frame.valid_px[triple.position]) AS E_plain,
        disparity_error(frame.gated_inconsistent_px[triple.position], frame.gated_valid_px[triple.position]) AS E_gated,
        judgement.statistic,
        judgement.theta[triple.position] AS theta,
        judgement.judgement_id IS NOT NULL AS judged,
        -- Of the fallback: whether a triple before it was measured and has a threshold.
        coalesce(triple.fallback, FALSE) AND len(list_filter(
            list_zip(
                CASE judgement.statistic WHEN 'gated' THEN frame.gated_valid_px ELSE frame.valid_px END,
                judgement.theta
            ),
            lambda x, p: p < triple.position AND x[1] >= min_valid_px() AND x[2] IS NOT NULL
        )) > 0 AS needless
    FROM stored_frames AS frame
    JOIN stored_measurements AS measurement USING (measurement_id)
    JOIN stored_triples AS triple USING (rig_id)
    LEFT JOIN judgements AS judgement ON judgement.measurement_id = frame.measurement_id AND judgement.current
    WHERE frame.skipped IS NULL
)

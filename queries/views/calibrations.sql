-- One row a statistic and triple, sensor check, or cause of a calibration, over all of its clean recordings.
--
-- column samples: What was measured of its clean frames, ascending: disparity errors E, statistics of sensor checks, or fault scores.
-- column N: Number of its samples.
-- column statistic: What is counted: plain or gated, a disparity error E of a triple; the name of a check; or a cause that is not an attack.
WITH made_of AS (
    SELECT calibration_id, any_value(recordings) AS recordings FROM stored_calibrations GROUP BY calibration_id
)
SELECT
    calibration_id,
    any_value(kind) AS kind,
    any_value(rig_kind) AS rig_kind,
    any_value(matcher) AS matcher,
    any_value(settings) AS settings,
    any_value(counting_version) AS counting_version,
    any_value(made_of.recordings) AS recordings,
    any_value(calibrated_at) AS calibrated_at,
    statistic,
    i,
    j,
    k,
    sensor,
    others,
    list_sort(list_filter(flatten(list(clean)), lambda x: x IS NOT NULL)) AS samples,
    len(list_filter(flatten(list(clean)), lambda x: x IS NOT NULL)) AS N
FROM stored_calibrations
JOIN made_of USING (calibration_id)
WHERE recording_id IS NOT NULL AND statistic NOT IN ('missing', 'standing_still', 'returns') AND NOT coalesce(for_parts, FALSE)
GROUP BY calibration_id, statistic, i, j, k, sensor, others

-- Thresholds theta of the paper's method at a designated false-alarm rate r: one row a statistic and triple of each calibration.
--
-- param r RATE = 0.01: The designated false-alarm rate.
-- param calibration VARCHAR = NULL: Only the calibration whose id begins so.
--
-- column kind: The rig kind in words.
-- column matcher: The stereo matcher that the samples were measured with.
-- column recordings: How many clean recordings the samples came from.
-- column statistic: Which pixels the disparity error counts: plain or gated.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column r: The designated false-alarm rate.
-- column N: Number of clean samples.
-- column theta: The sample of rank N - floor(r N); -1 at r = 1.
-- column resolvable: FALSE where 0 < r < 1/N: theta is then the maximum, as for r = 0.
-- column median: The middle of the samples.
-- column largest: The largest of the samples, which is theta at r = 0.
SELECT
    calibration_id,
    kind,
    matcher,
    len(recordings) AS recordings,
    statistic,
    i,
    j,
    k,
    N,
    list_median(samples) AS median,
    samples[len(samples)] AS largest,
    CAST($r AS DECIMAL(18, 17)) AS r,
    threshold(samples, CAST($r AS DECIMAL(18, 17))) AS theta,
    resolvable_with(N, CAST($r AS DECIMAL(18, 17))) AS resolvable
FROM calibrations
WHERE j IS NOT NULL AND ($calibration IS NULL OR starts_with(calibration_id, $calibration))
ORDER BY calibrated_at, calibration_id, statistic, k DESC, i, j

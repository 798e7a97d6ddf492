-- How the disparity errors E of each triple are distributed, by rig kind, with and without an attacked sensor in it.
--
-- param statistic VARCHAR = gated: Which pixels E counts: plain or gated.
-- param bins BIGINT = 50: Number of bins of equal width between 0 and 1.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column attacked: TRUE where labels say that a sensor of the triple was attacked, FALSE where they say that none was, NULL where the recording has no labels.
-- column frames: Frames that were measured.
-- column not_measured: Frames in which this E was not.
-- column smallest: Smallest E.
-- column median: Median E.
-- column q90: 90th percentile of E.
-- column q99: 99th percentile of E.
-- column largest: Largest E.
-- column histogram: Number of E in each bin, the last including 1.
WITH sample AS (
    SELECT
        measurement.kind,
        error.i,
        error.j,
        error.k,
        CASE WHEN truth.labelled THEN list_has_any(truth.truth, [error.i, error.j, error.k]) END AS attacked,
        CASE $statistic WHEN 'plain' THEN error.E_plain WHEN 'gated' THEN error.E_gated END AS E
    FROM errors AS error
    JOIN truth USING (measurement_id, frame)
    JOIN measurements AS measurement USING (measurement_id)
    WHERE $recording IS NULL OR measurement.name = $recording OR starts_with(measurement.recording_id, $recording)
),
binned AS (
    SELECT kind, i, j, k, attacked, least(floor(E * $bins), $bins - 1) AS bin, count(*) AS frames
    FROM sample WHERE E IS NOT NULL
    GROUP BY ALL
),
histogram AS (
    SELECT kind, i, j, k, attacked, map_from_entries(list((bin, frames))) AS counts FROM binned GROUP BY ALL
),
quantiles AS (
    SELECT
        kind,
        i,
        j,
        k,
        attacked,
        count(*) AS frames,
        count(*) - count(E) AS not_measured,
        min(E) AS smallest,
        quantile_disc(E, [0.5, 0.9, 0.99]) AS q,
        max(E) AS largest
    FROM sample
    GROUP BY ALL
)
SELECT
    quantiles.kind,
    quantiles.i,
    quantiles.j,
    quantiles.k,
    quantiles.attacked,
    frames,
    not_measured,
    smallest,
    q[1] AS median,
    q[2] AS q90,
    q[3] AS q99,
    largest,
    list_transform(range($bins), lambda bin: coalesce(counts[bin], 0)) AS histogram
FROM quantiles
LEFT JOIN histogram
    ON histogram.kind = quantiles.kind AND histogram.i = quantiles.i AND histogram.j = quantiles.j
    AND histogram.k = quantiles.k AND histogram.attacked IS NOT DISTINCT FROM quantiles.attacked
ORDER BY quantiles.kind, quantiles.k DESC, quantiles.i, quantiles.j, quantiles.attacked NULLS FIRST

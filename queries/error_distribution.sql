-- How the disparity errors E of each triple are distributed, by rig kind, with and without an attacked sensor in it.
--
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param bins BIGINT = 50: Number of bins of equal width between 0 and 1.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column kind: The rig kind in words.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column attacked: TRUE where labels say that a sensor of the triple was attacked, FALSE where they say that none was, NULL where the recording has no labels.
-- column frames: Frames that were measured.
-- column not_measured: Frames in which this E was not.
-- column smallest: Smallest E.
-- column median: Median E, to 0.0001 where many samples are close together, as the next two.
-- column q90: 90th percentile of E.
-- column q99: 99th percentile of E.
-- column largest: Largest E.
-- column histogram: Number of E in each bin, the last including 1.
WITH frame AS (
    SELECT
        measurement.kind,
        measurement.rig_id,
        CASE WHEN truth.labelled THEN truth.truth END AS truth,
        list_transform(
            CASE $statistic
                WHEN 'plain' THEN list_zip(inconsistent_px, valid_px)
                WHEN 'gated' THEN list_zip(gated_inconsistent_px, gated_valid_px)
            END,
            lambda px: disparity_error(px[1], px[2])
        ) AS E
    FROM frames
    JOIN truth USING (measurement_id, frame)
    JOIN measurements AS measurement USING (measurement_id)
    WHERE $recording IS NULL OR measurement.name = $recording OR starts_with(measurement.recording_id, $recording)
),
sample AS (
    SELECT kind, i, j, k, list_has_any(truth, [i, j, k]) AS attacked, E
    FROM (SELECT kind, rig_id, truth, unnest(E) AS E, generate_subscripts(E, 1) AS position FROM frame)
    JOIN paper_triples USING (rig_id, position)
),
-- Quantiles of any number of samples in bounded memory: each bin of 0.0001 is counted.
cell AS MATERIALIZED (
    SELECT
        kind,
        i,
        j,
        k,
        attacked,
        floor(E * 10000) AS fine,
        CASE WHEN E IS NOT NULL THEN least(floor(E * $bins), $bins - 1) END AS bin,
        count(*) AS frames,
        min(E) AS smallest,
        max(E) AS largest
    FROM sample
    GROUP BY ALL
),
ranked AS (
    SELECT
        *,
        sum(frames) FILTER (fine IS NOT NULL) OVER (
            PARTITION BY kind, i, j, k, attacked ORDER BY fine NULLS LAST, bin
            ROWS BETWEEN UNBOUNDED PRECEDING AND CURRENT ROW
        ) AS up_to,
        sum(frames) FILTER (fine IS NOT NULL) OVER (PARTITION BY kind, i, j, k, attacked) AS measured
    FROM cell
),
histogram AS (
    SELECT kind, i, j, k, attacked, map_from_entries(list((bin, frames))) AS counts
    FROM (SELECT kind, i, j, k, attacked, bin, sum(frames) AS frames FROM cell WHERE bin IS NOT NULL GROUP BY ALL)
    GROUP BY ALL
),
quantiles AS (
    SELECT
        kind,
        i,
        j,
        k,
        attacked,
        CAST(sum(frames) AS BIGINT) AS frames,
        CAST(coalesce(sum(frames) FILTER (fine IS NULL), 0) AS BIGINT) AS not_measured,
        min(smallest) AS smallest,
        min(largest) FILTER (up_to >= 0.5 * measured) AS median,
        min(largest) FILTER (up_to >= 0.9 * measured) AS q90,
        min(largest) FILTER (up_to >= 0.99 * measured) AS q99,
        max(largest) AS largest
    FROM ranked
    GROUP BY ALL
)
SELECT
    quantiles.*,
    list_transform(range($bins), lambda bin: CAST(coalesce(counts[bin], 0) AS BIGINT)) AS histogram
FROM quantiles
LEFT JOIN histogram
    ON histogram.kind = quantiles.kind AND histogram.i = quantiles.i AND histogram.j = quantiles.j
    AND histogram.k = quantiles.k AND histogram.attacked IS NOT DISTINCT FROM quantiles.attacked
ORDER BY quantiles.kind, quantiles.k DESC, quantiles.i, quantiles.j, quantiles.attacked NULLS FIRST

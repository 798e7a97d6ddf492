-- How the disparity errors of the leftmost camera's triples are distributed, clean and under each attack: the paper's Figs 5, 7 and 9.
--
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param bins BIGINT = 40: Number of bins of equal width between 0 and 1.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column attacked: The attacked sensors; empty for clean frames.
-- column strength: Amplitude of the faculas by name; NULL for clean frames.
-- column cases: Frames.
-- column not_measured: Those in which this E was not measured.
-- column smallest: Smallest E.
-- column median: Median E: the sample of that rank.
-- column q99: 99th percentile of E: the sample of that rank.
-- column largest: Largest E.
-- column histogram: Number of E in each bin, the last including 1.
WITH triple AS (
    SELECT rig_id, position, i, j, k FROM paper_triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS MATERIALIZED (
    SELECT
        setup,
        i,
        j,
        k,
        attacked,
        strength,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN triple USING (rig_id)
    WHERE experiment = 'clean'
        OR experiment = 'combinations' AND (len(attacked) = 1 OR list_has_all([i, j, k], attacked))
)
SELECT
    setup,
    i,
    j,
    k,
    attacked,
    strength,
    count(*) AS cases,
    count(*) - count(E) AS not_measured,
    min(E) AS smallest,
    quantile_disc(E, 0.5) AS median,
    quantile_disc(E, 0.99) AS q99,
    max(E) AS largest,
    list_transform(
        range($bins),
        lambda bin: len(list_filter(coalesce(list(E) FILTER (E IS NOT NULL), []), lambda x: least(floor(x * $bins), $bins - 1) = bin))
    ) AS histogram
FROM error
GROUP BY setup, i, j, k, attacked, strength
ORDER BY setup, i, j, k, len(attacked), attacked, strength

-- The largest attack of each kind that the robust method does not see at r = 1 %: of whoever aims anywhere, and of whoever knows the thresholds.
--
-- Of each frame and draw the largest size that leaves the frame clean, larger ones being taken for seen where a smaller one is. Half of them stay unseen up to `unseen_in_half`; who knows the thresholds and measures beforehand chooses place and moment, and stays unseen up to `unseen_at_best`, the size that one in ten reaches.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column left_out: What thresholds were not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column attacked: The attacked sensor.
-- column attack: The kind of attack.
-- column varied: What is varied, with its unit.
-- column tried: How many frames and draws were tried.
-- column smallest: The smallest size that was tried.
-- column largest: The largest size that was tried.
-- column unseen_in_half: The largest size that half of them reach unseen; 0 where the smallest is seen.
-- column unseen_at_best: The largest size that one in ten of them reaches unseen; 0 where the smallest is seen.
WITH by_all AS (
    SELECT judged.*
    FROM case_verdicts AS judged
    WHERE experiment = 'unseen'
    QUALIFY len(system) = max(len(system)) OVER (PARTITION BY judged.rig_id)
),
seen AS (
    SELECT
        *,
        min(size) FILTER (verdict <> 'clean') OVER (
            PARTITION BY setup, left_out, attacked, attack, strength, recording_id, frame, draw
        ) AS seen_from
    FROM by_all
),
reached AS (
    SELECT
        setup,
        left_out,
        attacked,
        attack,
        strength AS varied,
        recording_id,
        frame,
        draw,
        min(size) AS smallest,
        max(size) AS largest,
        coalesce(max(size) FILTER (seen_from IS NULL OR size < seen_from), 0) AS unseen
    FROM seen
    GROUP BY ALL
)
SELECT
    setup,
    left_out,
    attacked,
    attack,
    varied,
    count(*) AS tried,
    min(smallest) AS smallest,
    max(largest) AS largest,
    quantile_disc(unseen, 0.5) AS unseen_in_half,
    quantile_disc(unseen, 0.9) AS unseen_at_best
FROM reached
GROUP BY setup, left_out, attacked, attack, varied
ORDER BY setup, left_out, attacked, attack, varied

-- How small an attack is still detected: by the width of a wall and by the radius of a facula, in the paper's Scenario 1 (Figs 11 and 12).
--
-- The system is the LiDAR, the leftmost camera and the one farthest from it. The paper puts its faculas on the left, the reference camera; here the source camera is attacked as well.
--
-- param r RATE[] = 0.01: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column sensor: What is attacked: lidar, reference or source.
-- column strength: Amplitude of the faculas by name; NULL for walls.
-- column size: The wall's width in m, or the facula's R in px on an image 1242 px wide.
-- column nominal_share: The paper's contaminated area of such a facula: pi R^2 over 1242 x 375 px.
-- column visible_share: Mean share of the image that lies within R of the facula's centre.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from; NULL by the robust method.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column cases: Attacked frames.
-- column not_measured: Those in which nothing could be compared; they are not detected.
-- column detected: Those with E above theta, or whose robust verdict is not clean.
-- column rate: detected / cases.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
WITH threshold_of AS MATERIALIZED (
    FROM evaluation_thresholds(cases, $r, $statistic, $block_frames)
),
triple AS (
    SELECT rig_id, position, j, k FROM paper_triples
    WHERE i = 0 AND j = 1 QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS MATERIALIZED (
    SELECT
        setup,
        recording_id,
        frame // $block_frames AS block,
        attacked_role(attacked[1], k) AS sensor,
        strength,
        size,
        visible_share,
        position,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN triple USING (rig_id)
    WHERE experiment = 'sensitivity'
),
visible AS (
    SELECT setup, sensor, strength, size, avg(visible_share) AS visible_share FROM error GROUP BY ALL
),
judged AS (
    SELECT
        setup,
        'paper' AS method,
        left_out,
        sensor,
        strength,
        size,
        r,
        samples[position] AS samples,
        drives,
        resolvable_with(samples[position], r) AS resolvable,
        1 AS cases,
        E > theta[position] AS raised
    FROM error
    JOIN threshold_of USING (setup, recording_id, block)
    UNION ALL BY NAME
    SELECT
        setup,
        'robust' AS method,
        left_out,
        attacked_role(attacked[1], system[3]) AS sensor,
        strength,
        size,
        r,
        samples,
        drives,
        resolvable,
        cases,
        CASE WHEN verdict <> 'not_auditable' THEN raised END AS raised
    FROM robust_verdicts(case_verdicts, $r, $block_frames)
    WHERE experiment = 'sensitivity'
),
tally AS (
    SELECT
        setup,
        method,
        left_out,
        sensor,
        strength,
        size,
        r,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        CAST(sum(cases) AS BIGINT) AS cases,
        CAST(coalesce(sum(cases) FILTER (raised IS NULL), 0) AS BIGINT) AS not_measured,
        CAST(coalesce(sum(cases) FILTER (raised), 0) AS BIGINT) AS detected
    FROM judged
    GROUP BY ALL
)
SELECT
    tally.setup,
    method,
    left_out,
    tally.sensor,
    tally.strength,
    tally.size,
    CASE WHEN tally.sensor <> 'lidar' THEN pi() * tally.size ** 2 / (1242 * 375) END AS nominal_share,
    visible_share,
    CAST(r AS DOUBLE) AS r,
    samples,
    drives,
    resolvable,
    cases,
    not_measured,
    detected,
    detected / cases AS rate,
    wilson(detected, cases, -1) AS low,
    wilson(detected, cases, 1) AS high
FROM tally
JOIN visible ON visible.setup = tally.setup AND visible.sensor = tally.sensor AND visible.size = tally.size
    AND visible.strength IS NOT DISTINCT FROM tally.strength
ORDER BY tally.setup, method, left_out, tally.sensor, tally.strength, r, tally.size

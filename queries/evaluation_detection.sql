-- How often an attack is detected by three sensors, by method, by the sensors attacked and by r: the paper's Table I and its curves.
--
-- Each triple of the leftmost camera is a three-sensor system of its own: with the LiDAR the paper's Scenario 1, of three cameras its Scenario 2. Thresholds come from the clean frames of the same rig kind: of all, or of those that are not left out.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column scenario: 1 with the LiDAR, 2 of three cameras.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column strength: Amplitude of the faculas by name.
-- column attacked: The attacked sensors; NULL for all seven combinations together.
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
leftmost AS (
    SELECT rig_id, position, i, j, k FROM paper_triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS MATERIALIZED (
    SELECT
        setup,
        recording_id,
        frame // $block_frames AS block,
        strength,
        attacked,
        i,
        j,
        k,
        position,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN leftmost USING (rig_id)
    WHERE experiment = 'combinations' AND list_has_all([i, j, k], attacked)
),
judged AS (
    SELECT
        setup,
        'paper' AS method,
        left_out,
        i,
        j,
        k,
        strength,
        attacked,
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
        system[1] AS i,
        system[2] AS j,
        system[3] AS k,
        strength,
        attacked,
        r,
        samples,
        drives,
        resolvable,
        cases,
        CASE WHEN verdict <> 'not_auditable' THEN raised END AS raised
    FROM robust_verdicts(case_verdicts, $r, $block_frames)
    WHERE experiment = 'combinations' AND len(system) = 3
),
tally AS (
    SELECT
        setup,
        method,
        left_out,
        CASE WHEN i = 0 THEN 1 ELSE 2 END AS scenario,
        i,
        j,
        k,
        strength,
        attacked,
        r,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        CAST(sum(cases) AS BIGINT) AS cases,
        CAST(coalesce(sum(cases) FILTER (raised IS NULL), 0) AS BIGINT) AS not_measured,
        CAST(coalesce(sum(cases) FILTER (raised), 0) AS BIGINT) AS detected
    FROM judged
    GROUP BY GROUPING SETS (
        (setup, method, left_out, i, j, k, strength, attacked, r),
        (setup, method, left_out, i, j, k, strength, r)
    )
)
SELECT
    setup,
    method,
    left_out,
    scenario,
    i,
    j,
    k,
    strength,
    attacked,
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
ORDER BY setup, method, left_out, i, j, k, strength, r, len(attacked) NULLS LAST, attacked

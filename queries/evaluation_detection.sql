-- How often an attack raises the disparity error of three sensors above theta, by the sensors attacked and by r: the paper's Table I and its curves.
--
-- Each triple of the leftmost camera is a three-sensor system of its own: with the LiDAR the paper's Scenario 1, of three cameras its Scenario 2. Thresholds come from the clean frames of the same rig kind: of all, or of those that are not held out.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are held out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column held_out: What theta was not taken from: nothing (in sample), the block of the frame, or its recording.
-- column scenario: 1 with the LiDAR, 2 of three cameras.
-- column i: First witness.
-- column j: Second witness.
-- column k: Reference camera.
-- column strength: Amplitude of the faculas by name.
-- column attacked: The attacked sensors; NULL for all seven combinations together.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from.
-- column resolvable: FALSE where 0 < r < 1/N for some theta: it is then the maximum of its N samples.
-- column cases: Attacked frames.
-- column not_measured: Those without E or theta; they are not detected.
-- column detected: Those with E above theta.
-- column rate: detected / cases.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
WITH threshold_of AS MATERIALIZED (
    FROM evaluation_thresholds(cases, $r, $statistic, $block_frames)
),
leftmost AS (
    SELECT rig_id, position, i, j, k FROM triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
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
tally AS (
    SELECT
        setup,
        held_out,
        CASE WHEN i = 0 THEN 1 ELSE 2 END AS scenario,
        i,
        j,
        k,
        strength,
        attacked,
        r,
        min(samples[position]) AS samples,
        bool_and(resolvable_with(samples[position], r)) AS resolvable,
        count(*) AS cases,
        count(*) - count(E > theta[position]) AS not_measured,
        count_if(coalesce(E > theta[position], FALSE)) AS detected
    FROM error
    JOIN threshold_of USING (setup, recording_id, block)
    GROUP BY GROUPING SETS (
        (setup, held_out, i, j, k, strength, attacked, r),
        (setup, held_out, i, j, k, strength, r)
    )
)
SELECT
    setup,
    held_out,
    scenario,
    i,
    j,
    k,
    strength,
    attacked,
    CAST(r AS DOUBLE) AS r,
    samples,
    resolvable,
    cases,
    not_measured,
    CAST(detected AS BIGINT) AS detected,
    detected / cases AS rate,
    wilson(detected, cases, -1) AS low,
    wilson(detected, cases, 1) AS high
FROM tally
ORDER BY setup, held_out, i, j, k, strength, r, len(attacked) NULLS LAST, attacked

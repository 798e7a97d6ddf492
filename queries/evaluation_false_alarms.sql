-- How often clean frames are not clean: by three sensors of the leftmost camera, by the system of n = 3, and by all sensors.
--
-- By the paper's method this is about r in sample, by construction, for one disparity error, and more for a system, which has several. By the robust method r is the rate of a frame, whatever the number of its checks, in drives that it has not seen.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column system: The sensors that took part.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from; NULL by the robust method.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column frames: Clean frames.
-- column not_auditable: Those in which nothing was measured.
-- column raised: Those that are a finding: some disparity error of the system is above its theta, or the robust verdict is attacked, unidentified or suspect.
-- column rate: raised / frames.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
-- column not_clean: Those whose verdict is anything but clean: raised or not auditable.
-- column not_clean_rate: not_clean / frames.
-- column not_clean_low: Lower end of its interval.
-- column not_clean_high: Upper end of its interval.
-- column identified: Those whose verdict names a sensor.
-- column hours: Time that the frames stand for: their number times the usual time between two; NULL where there are no two, as all that follows.
-- column raised_an_hour: Raised frames per hour of driving.
-- column low_an_hour: Lower end of its interval.
-- column high_an_hour: Upper end of its interval; evaluation_incidents counts the incidents that they make.
WITH threshold_of AS MATERIALIZED (
    FROM evaluation_thresholds(cases, $r, $statistic, $block_frames)
),
verdict_of AS MATERIALIZED (
    FROM verdicts_by_method(cases, paper_triples, case_verdicts, $r, $statistic, $block_frames)
),
triple AS (
    SELECT rig_id, position, [i, j, k] AS system FROM paper_triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS (
    SELECT
        setup,
        recording_id,
        frame // $block_frames AS block,
        system,
        position,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN triple USING (rig_id)
    WHERE experiment = 'clean'
),
period AS (
    FROM usual_periods(cases)
),
counted AS (
    SELECT
        setup,
        'paper' AS method,
        left_out,
        system,
        r,
        min(samples[position]) AS samples,
        min(drives) AS drives,
        bool_and(resolvable_with(samples[position], r)) AS resolvable,
        count(*) AS frames,
        count(*) - count(E > theta[position]) AS not_auditable,
        CAST(count_if(coalesce(E > theta[position], FALSE)) AS BIGINT) AS raised,
        0 AS identified
    FROM error
    JOIN threshold_of USING (setup, recording_id, block)
    GROUP BY ALL
    UNION ALL
    SELECT
        setup,
        method,
        left_out,
        system,
        r,
        min(samples),
        min(drives),
        bool_and(resolvable),
        CAST(sum(cases) AS BIGINT),
        CAST(coalesce(sum(cases) FILTER (verdict = 'not_auditable'), 0) AS BIGINT),
        CAST(coalesce(sum(cases) FILTER (raised), 0) AS BIGINT),
        CAST(coalesce(sum(cases) FILTER (verdict = 'attacked'), 0) AS BIGINT)
    FROM (
        FROM verdict_of
        WHERE len(system) > 3
        UNION ALL BY NAME
        SELECT 'robust' AS method, *
        FROM robust_verdicts(case_verdicts, $r, $block_frames)
        WHERE len(system) = 3
    )
    WHERE experiment = 'clean'
    GROUP BY ALL
)
SELECT
    setup,
    method,
    left_out,
    system,
    CAST(r AS DOUBLE) AS r,
    samples,
    drives,
    resolvable,
    frames,
    not_auditable,
    raised,
    raised / frames AS rate,
    wilson(raised, frames, -1) AS low,
    wilson(raised, frames, 1) AS high,
    raised + not_auditable AS not_clean,
    not_clean / frames AS not_clean_rate,
    wilson(not_clean, frames, -1) AS not_clean_low,
    wilson(not_clean, frames, 1) AS not_clean_high,
    identified,
    frames * period_s / 3600 AS hours,
    raised / (frames * period_s / 3600) AS raised_an_hour,
    wilson(raised, frames, -1) * 3600 / period_s AS low_an_hour,
    wilson(raised, frames, 1) * 3600 / period_s AS high_an_hour
FROM counted
JOIN period USING (setup)
ORDER BY setup, method, left_out, len(system), system, r

-- How often attacks and faults beyond the paper's are detected and named: laser patterns, stripes, hidden sectors, scattered points, delayed, frozen and displaced sensors, one sensor at a time.
--
-- A sensor that hides or lags need not disagree with the others: where the rate is low, disparity errors do not see it.
--
-- param r RATE[] = 0.01: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column system: The sensors that took part.
-- column attack: The kind of attack or fault.
-- column variant: Which of its kind: bright or dark stripes, the pattern's file.
-- column size: Its size: a sector's width and a turn in degrees, points, rows in px, frames of delay, grey levels.
-- column attacked: The attacked sensors.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from; NULL by the robust method.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column cases: Attacked frames.
-- column detected: Those that are raised: some disparity error of the system is above its theta, or the verdict is not clean.
-- column rate: detected / cases.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
-- column named: Those in which exactly the attacked sensors are named.
-- column naming_rate: named / cases.
-- column naming_low: Lower end of its interval.
-- column naming_high: Upper end of its interval.
WITH verdict_of AS MATERIALIZED (
    FROM verdicts_by_method(cases, paper_triples, case_verdicts, $r, $statistic, $block_frames)
),
tally AS (
    SELECT
        setup,
        method,
        left_out,
        system,
        attack,
        strength AS variant,
        size,
        attacked,
        r,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        CAST(sum(cases) AS BIGINT) AS cases,
        CAST(coalesce(sum(cases) FILTER (raised), 0) AS BIGINT) AS detected,
        CAST(coalesce(sum(cases) FILTER (raised AND named = attacked), 0) AS BIGINT) AS named
    FROM verdict_of
    WHERE experiment IN ('further', 'patterns')
    GROUP BY ALL
)
SELECT
    setup,
    method,
    left_out,
    system,
    attack,
    variant,
    size,
    attacked,
    CAST(r AS DOUBLE) AS r,
    samples,
    drives,
    resolvable,
    cases,
    detected,
    detected / cases AS rate,
    wilson(detected, cases, -1) AS low,
    wilson(detected, cases, 1) AS high,
    named,
    named / cases AS naming_rate,
    wilson(named, cases, -1) AS naming_low,
    wilson(named, cases, 1) AS naming_high
FROM tally
ORDER BY setup, method, left_out, len(system), attack, attacked, variant, size, r

-- How often exactly the attacked sensors are named, by method, by the sensors attacked and by r: the paper's Table II and Fig. 10, and the same for two attacked sensors.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column system: The sensors that took part.
-- column strength: Amplitude of the faculas by name.
-- column attacked: The attacked sensors; NULL for all sets of this size together.
-- column attacked_sensors: How many they are.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from; NULL by the robust method.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column cases: Attacked frames.
-- column not_auditable: Those in which nothing was measured.
-- column named: Those in which exactly the attacked sensors are named: by Algorithm 2, which is what Table II counts, or by the robust verdict.
-- column rate: named / cases.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
-- column identified: Those of them whose verdict is attacked: the named sensors explain all that was measured.
-- column identification_rate: identified / cases.
-- column identification_low: Lower end of its interval.
-- column identification_high: Upper end of its interval.
-- column misnamed: Attacked frames whose verdict is attacked and names a sensor that is not.
-- column misnaming_rate: misnamed / cases.
-- column misnaming_low: Lower end of its interval.
-- column misnaming_high: Upper end of its interval.
WITH verdict_of AS MATERIALIZED (
    FROM verdicts_by_method(cases, paper_triples, case_verdicts, $r, $statistic, $block_frames)
),
tally AS (
    SELECT
        setup,
        method,
        left_out,
        system,
        strength,
        attacked,
        len(attacked) AS attacked_sensors,
        r,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        CAST(sum(cases) AS BIGINT) AS cases,
        CAST(coalesce(sum(cases) FILTER (verdict = 'not_auditable'), 0) AS BIGINT) AS not_auditable,
        CAST(coalesce(sum(cases) FILTER (raised AND named = attacked), 0) AS BIGINT) AS named,
        CAST(coalesce(sum(cases) FILTER (verdict = 'attacked' AND named = attacked), 0) AS BIGINT) AS identified,
        CAST(coalesce(sum(cases) FILTER (verdict = 'attacked' AND NOT list_has_all(attacked, named)), 0) AS BIGINT) AS misnamed
    FROM verdict_of
    WHERE experiment = 'combinations' AND len(system) >= 4
    GROUP BY GROUPING SETS (
        (setup, method, left_out, system, strength, attacked, len(attacked), r),
        (setup, method, left_out, system, strength, len(attacked), r)
    )
)
SELECT
    setup,
    method,
    left_out,
    system,
    strength,
    attacked,
    attacked_sensors,
    CAST(r AS DOUBLE) AS r,
    samples,
    drives,
    resolvable,
    cases,
    not_auditable,
    named,
    named / cases AS rate,
    wilson(named, cases, -1) AS low,
    wilson(named, cases, 1) AS high,
    identified,
    identified / cases AS identification_rate,
    wilson(identified, cases, -1) AS identification_low,
    wilson(identified, cases, 1) AS identification_high,
    misnamed,
    misnamed / cases AS misnaming_rate,
    wilson(misnamed, cases, -1) AS misnaming_low,
    wilson(misnamed, cases, 1) AS misnaming_high
FROM tally
ORDER BY setup, method, left_out, len(system), strength, r, attacked_sensors, attacked NULLS LAST

-- What an evaluation cost: time of measuring by experiment, and that of one attacked frame beside one clean frame.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column experiment: What was tried: clean, combinations, sensitivity, further, intervals or patterns.
-- column frames: Clean frames that were attacked.
-- column cases: Attacked frames that were measured.
-- column seconds: Time that it took, without reading recordings.
-- column cases_a_second: Attacked frames per second, in one process.
-- column ratio: Time for one case over the time for measuring one clean frame: only what an attack changes is measured again.
WITH spent AS (
    SELECT
        setup,
        experiment,
        CAST(sum(frames) AS BIGINT) AS frames,
        CAST(sum(cases) AS BIGINT) AS cases,
        sum(seconds) AS seconds
    FROM evaluations
    GROUP BY setup, experiment
),
clean AS (
    SELECT setup, seconds / nullif(cases, 0) AS clean_s FROM spent WHERE experiment = 'clean'
)
SELECT
    setup,
    experiment,
    frames,
    cases,
    seconds,
    cases / nullif(seconds, 0) AS cases_a_second,
    seconds / nullif(cases, 0) / nullif(clean_s, 0) AS ratio
FROM spent
LEFT JOIN clean USING (setup)
ORDER BY setup, experiment

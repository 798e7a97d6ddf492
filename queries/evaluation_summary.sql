-- The evaluation in short: clean frames that are not clean, detection in the paper's two scenarios and identification by both methods, averaged over the combinations, by strength and r.
--
-- The scenarios are those of the leftmost camera and the one farthest from it: with the LiDAR, and with the camera next to that one.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
-- param left_out VARCHAR = all: Only by thresholds without this: nothing, block, recording or family; a family of one recording is that recording.
--
-- column kind: The rig kind in words.
-- column synthetic: TRUE where the drives were made for the evaluation.
-- column matcher: The stereo matcher.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column strength: Amplitude of the faculas by name.
-- column r: The designated false-alarm rate.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column clean_frames: Clean frames, judged by all sensors.
-- column not_clean: The share of them whose verdict is anything but clean; r is what the robust method is asked for.
-- column scenario_1: Detection rate over the seven combinations of the LiDAR and two cameras.
-- column scenario_2: Detection rate over the seven combinations of three cameras.
-- column one_of_3: Identification rate of one attacked sensor among the LiDAR and three cameras.
-- column one_of_all: Identification rate of one attacked sensor among all sensors, where they are more.
-- column two_of_all: Identification rate of two attacked sensors among all sensors.
-- column misnamed: The share of attacked frames whose verdict, by all sensors, names a sensor that was not attacked.
WITH threshold_of AS MATERIALIZED (
    FROM evaluation_thresholds(cases, $r, $statistic, $block_frames)
),
verdict_of AS MATERIALIZED (
    FROM verdicts_by_method(cases, paper_triples, case_verdicts, $r, $statistic, $block_frames)
),
triple AS (
    SELECT rig_id, position, i, j, k FROM paper_triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS MATERIALIZED (
    SELECT
        setup,
        recording_id,
        frame // $block_frames AS block,
        strength,
        CASE WHEN i = 0 THEN 1 ELSE 2 END AS scenario,
        position,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN triple USING (rig_id)
    WHERE experiment = 'combinations' AND list_has_all([i, j, k], attacked) AND (i, j) IN ((0, 1), (1, 2))
),
judged AS (
    SELECT
        setup,
        'paper' AS method,
        left_out,
        scenario,
        strength,
        r,
        resolvable_with(samples[position], r) AS resolvable,
        1 AS cases,
        coalesce(E > theta[position], FALSE) AS raised
    FROM error
    JOIN threshold_of USING (setup, recording_id, block)
    UNION ALL BY NAME
    SELECT
        setup,
        'robust' AS method,
        left_out,
        CASE WHEN system[1] = 0 THEN 1 ELSE 2 END AS scenario,
        strength,
        r,
        resolvable,
        cases,
        raised
    FROM robust_verdicts(case_verdicts, $r, $block_frames)
    WHERE experiment = 'combinations' AND len(system) = 3 AND (system[1], system[2]) IN ((0, 1), (1, 2))
),
detection AS (
    SELECT
        setup,
        method,
        left_out,
        strength,
        r,
        bool_and(resolvable) AS resolvable,
        coalesce(sum(cases) FILTER (raised AND scenario = 1), 0) / sum(cases) FILTER (scenario = 1) AS scenario_1,
        coalesce(sum(cases) FILTER (raised AND scenario = 2), 0) / sum(cases) FILTER (scenario = 2) AS scenario_2
    FROM judged
    GROUP BY ALL
),
sized AS (
    SELECT
        *,
        len(attacked) AS hit,
        len(system) = max(len(system)) OVER (PARTITION BY setup) AS largest,
        largest AND len(system) > 4 AS everyone,
        coalesce(raised AND named = attacked, FALSE) AS right_name
    FROM verdict_of
    WHERE experiment = 'combinations' AND len(system) >= 4
),
alarm AS (
    SELECT
        setup,
        method,
        left_out,
        r,
        min(drives) AS drives,
        CAST(sum(cases) AS BIGINT) AS clean_frames,
        coalesce(sum(cases) FILTER (verdict <> 'clean'), 0) / sum(cases) AS not_clean
    FROM (
        FROM verdict_of
        WHERE experiment = 'clean'
        QUALIFY len(system) = max(len(system)) OVER (PARTITION BY setup)
    )
    GROUP BY setup, method, left_out, r
),
identification AS (
    SELECT
        setup,
        method,
        left_out,
        strength,
        r,
        coalesce(sum(cases) FILTER (right_name AND len(system) = 4 AND hit = 1), 0)
            / sum(cases) FILTER (len(system) = 4 AND hit = 1) AS one_of_3,
        coalesce(sum(cases) FILTER (right_name AND everyone AND hit = 1), 0)
            / sum(cases) FILTER (everyone AND hit = 1) AS one_of_all,
        coalesce(sum(cases) FILTER (right_name AND everyone AND hit = 2), 0)
            / sum(cases) FILTER (everyone AND hit = 2) AS two_of_all,
        coalesce(sum(cases) FILTER (largest AND verdict = 'attacked' AND NOT list_has_all(attacked, named)), 0)
            / sum(cases) FILTER (largest) AS misnamed
    FROM sized
    GROUP BY setup, method, left_out, strength, r
),
described AS (
    SELECT setup, any_value(kind) AS kind, any_value(synthetic) AS synthetic, any_value(matcher) AS matcher
    FROM evaluations
    GROUP BY setup
),
chosen AS (
    SELECT setup, CASE WHEN $left_out = 'family' AND NOT bool_or(left_out = 'family') THEN 'recording' ELSE $left_out END AS mode
    FROM detection
    GROUP BY setup
)
SELECT
    kind,
    synthetic,
    matcher,
    method,
    left_out,
    strength,
    CAST(r AS DOUBLE) AS r,
    resolvable,
    drives,
    clean_frames,
    not_clean,
    scenario_1,
    scenario_2,
    one_of_3,
    one_of_all,
    two_of_all,
    misnamed
FROM detection
LEFT JOIN alarm USING (setup, method, left_out, r)
LEFT JOIN identification USING (setup, method, left_out, strength, r)
JOIN described USING (setup)
JOIN chosen USING (setup)
WHERE mode IN ('all', left_out)
ORDER BY setup, method, left_out, strength, r

-- What the queries on evaluations share.

-- What counts may be pooled with: those made alike, on one rig kind, of real or of synthetic drives.
CREATE MACRO setup_of(kind, synthetic, matcher, settings, counting_version, experiments_version) AS
    left(md5(concat_ws('|', kind, synthetic, matcher, settings, counting_version, experiments_version)), 8);

-- E of every triple by the statistic named.
CREATE MACRO errors_by(statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px) AS
    list_transform(
        CASE statistic
            WHEN 'plain' THEN list_zip(inconsistent_px, valid_px)
            WHEN 'gated' THEN list_zip(gated_inconsistent_px, gated_valid_px)
        END,
        lambda px: disparity_error(px[1], px[2])
    );

-- The e vector: one character a triple; '-' where E or theta is not known.
CREATE MACRO states_of(E, theta) AS
    array_to_string(
        list_transform(
            list_zip(E, theta),
            lambda x: CASE WHEN x[1] > x[2] THEN '1' WHEN x[1] <= x[2] THEN '0' ELSE '-' END
        ),
        ''
    );

-- The usual time between two clean frames of each setup, in seconds; NULL where there are no two. A series of frames is
-- one recording by one rig; steps back, where the clock was set, do not count. `source` names the cases.
CREATE MACRO usual_periods(source) AS TABLE
WITH step AS (
    SELECT setup, stamp_ns - lag(stamp_ns) OVER (PARTITION BY setup, recording_id, rig_id ORDER BY frame) AS step_ns
    FROM query_table(source)
    WHERE experiment = 'clean'
)
SELECT setup, median(step_ns) FILTER (step_ns > 0) / 1e9 AS period_s FROM step GROUP BY setup;

-- theta by triple for the frames of each block of each recording, in sample (left_out = 'nothing') and left out: from
-- the clean frames of all other blocks ('block'), of all other recordings ('recording') or of all other families
-- ('family', where some family has more than one recording). `drives` counts the recordings that they come from.
-- `source` names the cases.
CREATE MACRO evaluation_thresholds(source, rates, statistic, block_frames) AS TABLE
WITH rate AS (
    SELECT DISTINCT unnest(CAST(rates AS DECIMAL(18, 17)[])) AS r
),
clean AS (
    SELECT
        setup,
        recording_id,
        family,
        frame // block_frames AS block,
        errors_by(statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px) AS errors
    FROM query_table(source)
    WHERE experiment = 'clean'
),
sample AS MATERIALIZED (
    SELECT setup, recording_id, family, block, unnest(errors) AS E, generate_subscripts(errors, 1) AS position FROM clean
),
block AS MATERIALIZED (
    SELECT DISTINCT setup, recording_id, family, block FROM sample
),
-- the families of setups in which some have more than one recording; elsewhere they are what recordings are
family AS (
    SELECT setup, unnest(list_distinct(list(family))) AS family
    FROM block
    GROUP BY setup
    HAVING count(DISTINCT family) < count(DISTINCT recording_id)
),
-- one fold is what is left out together, with the samples that are left
fold AS (
    SELECT 'nothing' AS left_out, setup, NULL AS fold_family, NULL AS fold_recording, NULL AS fold_block, position,
        list(E ORDER BY E) FILTER (E IS NOT NULL) AS samples, count(DISTINCT sample.recording_id) AS drives
    FROM sample
    GROUP BY setup, position
    UNION ALL
    SELECT 'block', block.setup, NULL, block.recording_id, block.block, position,
        list(E ORDER BY E) FILTER (E IS NOT NULL), count(DISTINCT sample.recording_id)
    FROM block
    JOIN sample ON sample.setup = block.setup
        AND (sample.recording_id <> block.recording_id OR sample.block <> block.block)
    GROUP BY block.setup, block.recording_id, block.block, position
    UNION ALL
    SELECT 'recording', recording.setup, NULL, recording.recording_id, NULL, position,
        list(E ORDER BY E) FILTER (E IS NOT NULL), count(DISTINCT sample.recording_id)
    FROM (SELECT DISTINCT setup, recording_id FROM block) AS recording
    JOIN sample ON sample.setup = recording.setup AND sample.recording_id <> recording.recording_id
    GROUP BY recording.setup, recording.recording_id, position
    UNION ALL
    SELECT 'family', family.setup, family.family, NULL, NULL, position,
        list(E ORDER BY E) FILTER (E IS NOT NULL), count(DISTINCT sample.recording_id)
    FROM family
    JOIN sample ON sample.setup = family.setup AND sample.family <> family.family
    GROUP BY family.setup, family.family, position
),
theta AS (
    SELECT
        left_out,
        setup,
        fold_family,
        fold_recording,
        fold_block,
        r,
        list(threshold(samples, r) ORDER BY position) AS theta,
        list(len(samples) ORDER BY position) AS samples,
        max(drives) AS drives
    FROM fold CROSS JOIN rate
    GROUP BY ALL
)
SELECT theta.setup, left_out, block.recording_id, block.block, r, theta, samples, drives
FROM theta
JOIN block ON block.setup = theta.setup
    AND (fold_family IS NULL OR fold_family = block.family)
    AND (fold_recording IS NULL OR fold_recording = block.recording_id)
    AND (fold_block IS NULL OR fold_block = block.block);

-- The e vector of every case that was measured for every triple, by system, r and what theta was not taken from.
-- Systems are all sensors, and of more than three cameras with a LiDAR also the LiDAR with S_n, S_1 and S_2: the
-- leftmost camera and the two farthest from it. `source` names the cases, `sensors` the triples.
CREATE MACRO evaluation_states(source, sensors, rates, statistic, block_frames) AS TABLE
WITH threshold_of AS MATERIALIZED (
    FROM evaluation_thresholds(source, rates, statistic, block_frames)
),
layout AS MATERIALIZED (
    SELECT
        rig_id,
        list({i: i, j: j, k: k} ORDER BY position) AS triples,
        list_sort(list_distinct(list_concat(list(i), list(j), list(k)))) AS everyone
    FROM query_table(sensors)
    GROUP BY rig_id
),
-- `everyone` of the larger systems, of four sensors those of n = 3
system AS MATERIALIZED (
    SELECT rig_id, triples, everyone AS system FROM layout
    UNION ALL
    SELECT rig_id, triples, [everyone[1], everyone[2], everyone[3], everyone[-1]]
    FROM layout
    WHERE len(everyone) > 4 AND everyone[1] = 0
),
error AS MATERIALIZED (
    SELECT
        setup,
        rig_id,
        recording_id,
        evaluation_id,
        frame // block_frames AS block,
        frame,
        stamp_ns,
        draw,
        experiment,
        attack,
        strength,
        size,
        attacked,
        errors_by(statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px) AS E
    FROM query_table(source)
    WHERE experiment <> 'sensitivity'
)
SELECT
    error.setup,
    error.rig_id,
    error.recording_id,
    error.evaluation_id,
    error.frame,
    error.stamp_ns,
    error.draw,
    threshold_of.left_out,
    system.system,
    system.triples,
    error.experiment,
    error.attack,
    error.strength,
    error.size,
    error.attacked,
    threshold_of.r,
    states_of(
        list_transform(
            error.E[:len(system.triples)],
            lambda x, p: CASE
                WHEN list_has_all(
                    system.system, [system.triples[p]['i'], system.triples[p]['j'], system.triples[p]['k']]
                ) THEN x
            END
        ),
        theta[:len(system.triples)]
    ) AS e,
    list_min(samples[:len(system.triples)]) AS samples,
    threshold_of.drives,
    len(list_filter(samples[:len(system.triples)], lambda N: NOT resolvable_with(N, threshold_of.r))) = 0 AS resolvable
FROM error
JOIN system USING (rig_id)
JOIN threshold_of USING (setup, recording_id, block)
WHERE list_has_all(system.system, error.attacked)
    AND (error.experiment <> 'combinations' OR len(error.attacked) <= len(system.system) - 3);

-- The paper's verdict on e, with Algorithm 2's answer: the sensors that took part, and those that it names.
CREATE MACRO paper_verdict(e, triples, system, named) AS CASE
    WHEN system = [] THEN 'not_auditable'
    WHEN NOT contains(e, '1') THEN 'clean'
    WHEN len(system) >= 4 AND len(named) BETWEEN 1 AND len(system) - 3 AND explains(named, e, triples) THEN 'attacked'
    ELSE 'unidentified'
END;

-- Algorithm 2's verdicts on them, counted: by system, truth and verdict.
CREATE MACRO evaluation_verdicts(source, sensors, rates, statistic, block_frames) AS TABLE
WITH counted AS MATERIALIZED (
    SELECT
        setup,
        left_out,
        system,
        triples,
        experiment,
        attack,
        strength,
        size,
        attacked,
        r,
        e,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        count(*) AS cases
    FROM evaluation_states(source, sensors, rates, statistic, block_frames)
    GROUP BY ALL
),
pattern AS MATERIALIZED (
    SELECT DISTINCT e, triples FROM counted
),
answer AS MATERIALIZED (
    FROM algorithm2(pattern)
)
SELECT
    counted.setup,
    counted.left_out,
    counted.system,
    counted.experiment,
    counted.attack,
    counted.strength,
    counted.size,
    counted.attacked,
    counted.r,
    paper_verdict(counted.e, counted.triples, answer.system, answer.named) AS verdict,
    answer.named,
    contains(counted.e, '1') AS raised,
    counted.samples,
    counted.drives,
    counted.resolvable,
    counted.cases
FROM counted
JOIN answer ON answer.e = counted.e AND answer.triples = counted.triples;

-- What an attacked sensor is in the system of the LiDAR, the leftmost camera k and the one farthest from it.
CREATE MACRO attacked_role(sensor, k) AS CASE sensor WHEN 0 THEN 'lidar' WHEN k THEN 'reference' ELSE 'source' END;

-- The robust method's verdicts on all cases, counted alike; only its own r and blocks were judged. Its thresholds come
-- from drives, not from samples, so that it resolves every r. `judged` names the table of verdicts.
CREATE MACRO robust_verdicts(judged, rates, block_frames) AS TABLE
SELECT
    setup,
    left_out,
    system,
    experiment,
    attack,
    strength,
    size,
    attacked,
    r,
    verdict,
    CASE WHEN verdict = 'attacked' THEN identified END AS named,
    verdict NOT IN ('clean', 'not_auditable') AS raised,
    CAST(NULL AS BIGINT) AS samples,
    min(drives) AS drives,
    TRUE AS resolvable,
    count(*) AS cases
FROM query_table(judged)
WHERE list_contains(CAST(rates AS DECIMAL(18, 17)[]), r) AND (left_out <> 'block' OR block_frames = robust_block_frames())
GROUP BY ALL;

-- Both, of systems of more than three sensors; of rigs without one of all three.
CREATE MACRO verdicts_by_method(source, sensors, judged, rates, statistic, block_frames) AS TABLE
SELECT 'paper' AS method, * FROM evaluation_verdicts(source, sensors, rates, statistic, block_frames)
UNION ALL BY NAME
SELECT 'robust' AS method, *
FROM robust_verdicts(judged, rates, block_frames)
QUALIFY len(system) > 3 OR len(system) = max(len(system)) OVER (PARTITION BY setup);

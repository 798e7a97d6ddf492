-- How often objects that two sensors see do not match, by the sensors attacked: the object-level baseline of the paper's Table I, with the false alarms that it costs.
--
-- A frame is a detection where its mismatch is above a threshold from clean frames, as in the method's own tables. The mismatch is the score of the surest object without a partner or, of detectors that give no scores, the share of objects without one. Where r is NULL, any object without a partner raises a frame, of scores those above 0.5: that rule learns nothing from clean frames.
--
-- param iou RATE[] = 0.5, 0.7: Intersection over union from which two objects are partners.
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column detector: What found the objects: geometric, or the files of the networks; text from outside.
-- column detector_id: What was pooled: the same networks with the same descriptions.
-- column left_out: What the threshold was not taken from: nothing (in sample), the block of the frame, or its recording; NULL where nothing is learnt.
-- column scenario: 1 with the LiDAR, 2 of three cameras.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera.
-- column k: Reference camera.
-- column iou: Intersection over union from which two objects are partners.
-- column r: The designated false-alarm rate; NULL where any object without a partner raises a frame.
-- column strength: Amplitude of the faculas by name.
-- column attacked: The attacked sensors; NULL for all seven combinations together.
-- column samples: The smallest number N of clean samples that a threshold came from.
-- column resolvable: FALSE where 0 < r < 1/N for some threshold: it is then the maximum of its N samples.
-- column cases: Attacked frames.
-- column detected: Those that are raised.
-- column rate: detected / cases.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
-- column frames: Clean frames.
-- column raised: Those that are raised.
-- column false_alarm_rate: raised / frames.
-- column false_alarm_low: Lower end of its interval.
-- column false_alarm_high: Upper end of its interval.
WITH rate AS (
    SELECT DISTINCT unnest(CAST($r AS DECIMAL(18, 17)[])) AS r
),
least AS (
    SELECT DISTINCT unnest(CAST($iou AS DOUBLE[])) AS iou
),
leftmost AS (
    SELECT rig_id, position, i, j, k FROM paper_triples QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
agreement AS MATERIALIZED (
    SELECT
        setup,
        detector,
        detector_id,
        recording_id,
        frame // $block_frames AS block,
        experiment,
        strength,
        attacked,
        i,
        j,
        k,
        iou,
        if(scores[position] IS NULL, 0.0, 0.5) AS unlearnt,
        unmatched(best_iou[position], scores[position], iou) AS mismatch
    FROM object_cases
    JOIN leftmost USING (rig_id)
    CROSS JOIN least
    WHERE experiment IN ('clean', 'combinations') AND best_iou[position] IS NOT NULL
),
clean AS MATERIALIZED (
    SELECT setup, detector_id, i, j, k, iou, recording_id, block, unlearnt, mismatch
    FROM agreement
    WHERE experiment = 'clean'
),
place AS (
    SELECT setup, detector_id, i, j, k, iou, recording_id, block, max(unlearnt) AS unlearnt FROM clean GROUP BY ALL
),
-- one fold is what is left out together, with the samples that are left
fold AS (
    SELECT
        left_out,
        place.setup,
        place.detector_id,
        place.i,
        place.j,
        place.k,
        place.iou,
        place.recording_id,
        place.block,
        list(clean.mismatch ORDER BY clean.mismatch) AS samples
    FROM place
    JOIN clean USING (setup, detector_id, i, j, k, iou)
    CROSS JOIN (VALUES ('nothing'), ('block'), ('recording')) AS mode(left_out)
    WHERE left_out = 'nothing'
        OR clean.recording_id <> place.recording_id
        OR left_out = 'block' AND clean.block <> place.block
    GROUP BY ALL
),
threshold_of AS (
    SELECT * REPLACE (len(samples) AS samples), threshold(samples, r) AS theta FROM fold CROSS JOIN rate
    UNION ALL BY NAME
    SELECT * EXCLUDE (unlearnt), NULL AS left_out, NULL AS r, unlearnt AS theta, NULL AS samples FROM place
),
tally AS MATERIALIZED (
    SELECT
        setup,
        detector,
        detector_id,
        left_out,
        i,
        j,
        k,
        iou,
        r,
        experiment,
        strength,
        attacked,
        min(samples) AS samples,
        bool_and(resolvable_with(samples, r)) AS resolvable,
        count(*) AS cases,
        count_if(mismatch > theta) AS raised
    FROM agreement
    JOIN threshold_of USING (setup, detector_id, i, j, k, iou, recording_id, block)
    GROUP BY GROUPING SETS (
        (setup, detector, detector_id, left_out, i, j, k, iou, r, experiment, strength, attacked),
        (setup, detector, detector_id, left_out, i, j, k, iou, r, experiment, strength)
    )
)
SELECT
    attack.setup,
    attack.detector,
    attack.detector_id,
    attack.left_out,
    CASE WHEN attack.i = 0 THEN 1 ELSE 2 END AS scenario,
    attack.i,
    attack.j,
    attack.k,
    attack.iou,
    CAST(attack.r AS DOUBLE) AS r,
    attack.strength,
    attack.attacked,
    attack.samples,
    attack.resolvable,
    attack.cases,
    CAST(attack.raised AS BIGINT) AS detected,
    attack.raised / attack.cases AS rate,
    wilson(attack.raised, attack.cases, -1) AS low,
    wilson(attack.raised, attack.cases, 1) AS high,
    calm.cases AS frames,
    CAST(calm.raised AS BIGINT) AS raised,
    calm.raised / calm.cases AS false_alarm_rate,
    wilson(calm.raised, calm.cases, -1) AS false_alarm_low,
    wilson(calm.raised, calm.cases, 1) AS false_alarm_high
FROM tally AS attack
JOIN tally AS calm
    ON calm.experiment = 'clean' AND calm.attacked IS NULL
    AND calm.setup = attack.setup AND calm.detector = attack.detector AND calm.detector_id = attack.detector_id
    AND calm.i = attack.i AND calm.j = attack.j AND calm.k = attack.k AND calm.iou = attack.iou
    AND calm.left_out IS NOT DISTINCT FROM attack.left_out AND calm.r IS NOT DISTINCT FROM attack.r
WHERE attack.experiment = 'combinations'
ORDER BY
    attack.setup,
    attack.detector,
    attack.detector_id,
    attack.left_out NULLS FIRST,
    attack.i,
    attack.j,
    attack.k,
    attack.iou,
    attack.r NULLS FIRST,
    attack.strength,
    len(attack.attacked) NULLS LAST,
    attack.attacked

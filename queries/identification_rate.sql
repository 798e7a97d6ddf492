-- How often Algorithm 2 names exactly the attacked sensors, by designated false-alarm rate r: the paper's Table II.
--
-- Only recordings with labels count: those that carry some, and those that auditor label has given some, or marked as
-- clean. Thresholds are taken anew from the calibration's samples at every r. Rates stand with Wilson's 95 % interval.
--
-- param r RATE[] = 0, 0.01, 0.02, 0.03, 0.05: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param calibration VARCHAR = NULL: The calibration whose id begins so; by default that of each measurement's current judgement.
--
-- column kind: The rig kind in words.
-- column transferred: TRUE where the calibration is of another rig kind, or of a similar one.
-- column in_sample: TRUE where the recording is one of those that were calibrated on.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from.
-- column resolvable: FALSE where 0 < r < 1/N for some triple: theta is then the maximum of its N samples.
-- column attacked: The sensors that labels say were attacked; empty for frames of labelled recordings that no label covers.
-- column frames: Measured frames.
-- column not_auditable: Those without a single measured state.
-- column detected: Those of an attack in which e has a 1.
-- column detection_rate: detected / frames.
-- column detection_low: Lower end of its interval.
-- column detection_high: Upper end of its interval.
-- column named: Those of an attack in which Algorithm 2 names exactly the attacked sensors, which is what Table II counts.
-- column naming_rate: named / frames.
-- column naming_low: Lower end of its interval.
-- column naming_high: Upper end of its interval.
-- column identified: Those of them whose verdict is attacked: four sensors took part at least, and the named ones explain e.
-- column identification_rate: identified / frames.
-- column identification_low: Lower end of its interval.
-- column identification_high: Upper end of its interval.
-- column false_alarms: Frames that no label covers in which e has a 1.
-- column false_alarm_rate: false_alarms / frames.
-- column false_alarm_low: Lower end of its interval.
-- column false_alarm_high: Upper end of its interval.
WITH rate AS (
    SELECT DISTINCT unnest(CAST($r AS DECIMAL(18, 17)[])) AS r
),
layout AS (
    SELECT rig_id, list({i: i, j: j, k: k} ORDER BY position) AS triples FROM paper_triples GROUP BY rig_id
),
calibration AS (
    SELECT DISTINCT calibration_id, matcher, settings, counting_version, rig_kind, recordings FROM calibrations
),
-- which calibration each measurement is judged by, and whether it was calibrated on itself
chosen AS MATERIALIZED (
    SELECT
        measurement.measurement_id,
        measurement.rig_id,
        rig.kind,
        calibration.calibration_id,
        -- the numbers of the rig's sensors in the calibration's, where the rig is a part of that
        CASE
            WHEN judgement.calibration_id = calibration.calibration_id AND len(judgement.absent_sensors) > 0
                THEN judgement.calibrated_as
        END AS calibrated_as,
        CASE
            WHEN judgement.calibration_id = calibration.calibration_id THEN judgement.transferred
            ELSE NOT kinds_match(rig.rig_kind, calibration.rig_kind)
        END AS transferred,
        list_contains(calibration.recordings, measurement.recording_id) AS in_sample
    FROM measurements AS measurement
    JOIN rigs AS rig USING (rig_id)
    JOIN calibration USING (matcher, settings, counting_version)
    LEFT JOIN judgements AS judgement
        ON judgement.measurement_id = measurement.measurement_id AND judgement.current
    WHERE CASE
        WHEN $calibration IS NULL THEN calibration.calibration_id = judgement.calibration_id
        ELSE starts_with(calibration.calibration_id, $calibration)
    END
),
thresholds AS MATERIALIZED (
    SELECT
        calibration_id,
        rig_id,
        r,
        list(threshold(samples, r) ORDER BY position) AS theta,
        min(N) AS samples,
        bool_and(resolvable_with(N, r)) AS resolvable
    FROM (
        SELECT
            part.calibration_id,
            part.rig_id,
            triple.position,
            number_there(triple.i, rig.rig_kind['lidar'], part.calibrated_as) AS i,
            number_there(triple.j, rig.rig_kind['lidar'], part.calibrated_as) AS j,
            number_there(triple.k, rig.rig_kind['lidar'], part.calibrated_as) AS k
        FROM (SELECT DISTINCT calibration_id, rig_id, calibrated_as FROM chosen) AS part
        JOIN paper_triples AS triple USING (rig_id)
        JOIN rigs AS rig USING (rig_id)
    )
    LEFT JOIN (SELECT * FROM calibrations WHERE statistic = $statistic AND N > 0) USING (calibration_id, i, j, k)
    CROSS JOIN rate
    GROUP BY calibration_id, rig_id, r
),
sample AS MATERIALIZED (
    SELECT
        measurement_id,
        truth.truth AS attacked,
        list_transform(
            CASE $statistic
                WHEN 'plain' THEN list_zip(inconsistent_px, valid_px)
                WHEN 'gated' THEN list_zip(gated_inconsistent_px, gated_valid_px)
            END,
            lambda px: disparity_error(px[1], px[2])
        ) AS E
    FROM frames
    JOIN truth USING (measurement_id, frame)
    WHERE truth.labelled AND measurement_id IN (SELECT measurement_id FROM chosen)
),
-- the e vector of each frame at each r; few of them differ
counted AS MATERIALIZED (
    SELECT
        chosen.calibration_id,
        chosen.rig_id,
        chosen.kind,
        chosen.transferred,
        chosen.in_sample,
        thresholds.r,
        sample.attacked,
        array_to_string(
            list_transform(
                list_zip(sample.E, thresholds.theta, TRUE),
                lambda x: CASE WHEN x[1] > x[2] THEN '1' WHEN x[1] <= x[2] THEN '0' ELSE '-' END
            ),
            ''
        ) AS e,
        count(*) AS frames
    FROM sample
    JOIN chosen USING (measurement_id)
    JOIN thresholds USING (calibration_id, rig_id)
    GROUP BY ALL
),
pattern AS (
    SELECT DISTINCT e, triples FROM counted JOIN layout USING (rig_id)
),
answer AS MATERIALIZED (
    FROM algorithm2(pattern)
),
outcome AS (
    SELECT
        counted.*,
        contains(counted.e, '1') AS raised,
        system = [] AS not_auditable,
        coalesce(answer.named = counted.attacked, FALSE) AS right_name,
        len(system) >= 4 AND len(answer.named) <= len(system) - 3
            AND explains(answer.named, counted.e, layout.triples) AS attributable
    FROM counted
    JOIN layout USING (rig_id)
    JOIN answer ON answer.e = counted.e AND answer.triples = layout.triples
),
tally AS (
    SELECT
        outcome.kind,
        outcome.calibration_id,
        outcome.transferred,
        outcome.in_sample,
        outcome.r,
        min(thresholds.samples) AS samples,
        bool_and(thresholds.resolvable) AS resolvable,
        outcome.attacked,
        CAST(sum(frames) AS BIGINT) AS frames,
        CAST(coalesce(sum(frames) FILTER (not_auditable), 0) AS BIGINT) AS not_auditable,
        CAST(coalesce(sum(frames) FILTER (raised), 0) AS BIGINT) AS raised,
        CAST(coalesce(sum(frames) FILTER (raised AND right_name), 0) AS BIGINT) AS named,
        CAST(coalesce(sum(frames) FILTER (raised AND right_name AND attributable), 0) AS BIGINT) AS identified
    FROM outcome
    JOIN thresholds USING (calibration_id, rig_id, r)
    GROUP BY outcome.kind, outcome.calibration_id, outcome.transferred, outcome.in_sample, outcome.r, outcome.attacked
),
split AS (
    SELECT
        * EXCLUDE (raised, named, identified),
        CASE WHEN attacked <> [] THEN raised END AS detected,
        CASE WHEN attacked <> [] THEN named END AS named,
        CASE WHEN attacked <> [] THEN identified END AS identified,
        CASE WHEN attacked = [] THEN raised END AS false_alarms
    FROM tally
)
SELECT
    kind,
    calibration_id,
    transferred,
    in_sample,
    CAST(r AS DOUBLE) AS r,
    samples,
    resolvable,
    attacked,
    frames,
    not_auditable,
    detected,
    detected / frames AS detection_rate,
    wilson(detected, frames, -1) AS detection_low,
    wilson(detected, frames, 1) AS detection_high,
    named,
    named / frames AS naming_rate,
    wilson(named, frames, -1) AS naming_low,
    wilson(named, frames, 1) AS naming_high,
    identified,
    identified / frames AS identification_rate,
    wilson(identified, frames, -1) AS identification_low,
    wilson(identified, frames, 1) AS identification_high,
    false_alarms,
    false_alarms / frames AS false_alarm_rate,
    wilson(false_alarms, frames, -1) AS false_alarm_low,
    wilson(false_alarms, frames, 1) AS false_alarm_high
FROM split
ORDER BY kind, calibration_id, transferred, in_sample, r, len(attacked), attacked

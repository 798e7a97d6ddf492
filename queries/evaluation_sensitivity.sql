-- How small an attack is still detected: by the width of a wall and by the radius of a facula, in the paper's Scenario 1 (Figs 11 and 12).
--
-- The system is the LiDAR, the leftmost camera and the one farthest from it. The paper puts its faculas on the left, the reference camera; the witness is attacked here as well.
--
-- param r RATE[] = 0.01: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are held out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column held_out: What theta was not taken from: nothing (in sample), the block of the frame, or its recording.
-- column sensor: What is attacked: lidar, reference or witness.
-- column strength: Amplitude of the faculas by name; NULL for walls.
-- column size: The wall's width in m, or the facula's R in px on an image 1242 px wide.
-- column nominal_share: The paper's contaminated area of such a facula: pi R^2 over 1242 x 375 px.
-- column visible_share: Mean share of the image that lies within R of the facula's centre.
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
triple AS (
    SELECT rig_id, position, j, k FROM triples
    WHERE i = 0 AND j = 1 QUALIFY k = max(k) OVER (PARTITION BY rig_id)
),
error AS MATERIALIZED (
    SELECT
        setup,
        recording_id,
        frame // $block_frames AS block,
        CASE attacked[1] WHEN 0 THEN 'lidar' WHEN k THEN 'reference' WHEN j THEN 'witness' END AS sensor,
        strength,
        size,
        visible_share,
        position,
        errors_by($statistic, valid_px, inconsistent_px, gated_valid_px, gated_inconsistent_px)[position] AS E
    FROM cases
    JOIN triple USING (rig_id)
    WHERE experiment = 'sensitivity'
),
tally AS (
    SELECT
        setup,
        held_out,
        sensor,
        strength,
        size,
        avg(visible_share) AS visible_share,
        r,
        min(samples[position]) AS samples,
        bool_and(resolvable_with(samples[position], r)) AS resolvable,
        count(*) AS cases,
        count(*) - count(E > theta[position]) AS not_measured,
        CAST(count_if(coalesce(E > theta[position], FALSE)) AS BIGINT) AS detected
    FROM error
    JOIN threshold_of USING (setup, recording_id, block)
    GROUP BY setup, held_out, sensor, strength, size, r
)
SELECT
    setup,
    held_out,
    sensor,
    strength,
    size,
    CASE WHEN sensor <> 'lidar' THEN pi() * size ** 2 / (1242 * 375) END AS nominal_share,
    visible_share,
    CAST(r AS DOUBLE) AS r,
    samples,
    resolvable,
    cases,
    not_measured,
    detected,
    detected / cases AS rate,
    wilson(detected, cases, -1) AS low,
    wilson(detected, cases, 1) AS high
FROM tally
ORDER BY setup, held_out, sensor, strength, r, size

-- How well object detectors do on attacked data: average precision by the width of a wall and by the radius of a facula, against KITTI's labels or a street's own truth (the paper's Figs 11b and 12b).
--
-- Objects are matched as in KITTI's object benchmark at its moderate difficulty: in the image for a camera's detector, seen from above for a cloud's.
--
-- param points BIGINT = 40: Recalls at which precision is averaged: 40, or 11 as in KITTI's older benchmark.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column detector: What found the objects: the files of the networks; text from outside.
-- column detector_id: What was pooled: the same networks with the same descriptions.
-- column sensor: Whose data was looked at: lidar or reference.
-- column label: The kind of object.
-- column iou: Intersection over union that a hit reaches.
-- column strength: Amplitude of the faculas by name; NULL for walls and clean frames.
-- column size: The wall's width in m, or the facula's R in px on an image 1242 px wide; NULL for clean frames.
-- column nominal_share: The paper's contaminated area of such a facula: pi R^2 over 1242 x 375 px.
-- column visible_share: Mean share of the image that lies within R of the facula's centre.
-- column cases: Frames.
-- column truths: Labelled objects that are to be found.
-- column detections: Objects that were found, rightly or wrongly.
-- column hits: Those that match a labelled one.
-- column average_precision: Mean of the best precision at each recall or a higher one; NULL where nothing is to be found.
WITH scored AS (
    SELECT setup, detector, detector_id, strength, size, visible_share, unnest(scored) AS one FROM object_cases
),
-- fields of a struct that are NULL are equal, unlike columns
named AS MATERIALIZED (
    SELECT
        {
            setup: setup,
            detector: detector,
            detector_id: detector_id,
            sensor: CASE one['sensor'] WHEN 0 THEN 'lidar' ELSE 'reference' END,
            label: one['label'],
            iou: one['iou'],
            strength: strength,
            size: size
        } AS what,
        visible_share,
        one
    FROM scored
),
total AS (
    SELECT
        what,
        avg(visible_share) AS visible_share,
        count(*) AS cases,
        CAST(sum(one['truths']) AS BIGINT) AS truths,
        CAST(sum(len(one['scores'])) AS BIGINT) AS detections,
        CAST(sum(len(list_filter(one['hits'], lambda x: x))) AS BIGINT) AS hits
    FROM named
    GROUP BY what
),
found AS (
    SELECT what, unnest(one['scores']) AS score, unnest(one['hits']) AS hit FROM named
),
-- objects of one score come and go together
curve AS (
    SELECT what, sum(count_if(hit)) OVER surer AS hits, sum(count(*)) OVER surer AS detections
    FROM found
    GROUP BY what, score
    WINDOW surer AS (PARTITION BY what ORDER BY score DESC)
),
recall AS (
    SELECT unnest(range(if($points = 11, 0, 1), steps + 1)) AS step, steps
    FROM (SELECT if($points = 11, 10, $points) AS steps)
),
precision_at AS (
    SELECT
        total.what,
        step,
        coalesce(max(curve.hits / curve.detections) FILTER (curve.hits * steps >= step * truths), 0) AS best
    FROM total
    CROSS JOIN recall
    LEFT JOIN curve ON curve.what = total.what
    GROUP BY total.what, step
),
average AS (
    SELECT what, list_reduce(list(best ORDER BY step), lambda x, y: x + y) / count(*) AS average_precision
    FROM precision_at
    GROUP BY what
)
SELECT
    what['setup'] AS setup,
    what['detector'] AS detector,
    what['detector_id'] AS detector_id,
    what['sensor'] AS sensor,
    what['label'] AS label,
    what['iou'] AS iou,
    what['strength'] AS strength,
    what['size'] AS size,
    CASE WHEN what['strength'] IS NOT NULL THEN pi() * what['size'] ** 2 / (1242 * 375) END AS nominal_share,
    visible_share,
    cases,
    truths,
    detections,
    hits,
    CASE WHEN truths > 0 THEN average_precision END AS average_precision
FROM total
JOIN average USING (what)
ORDER BY setup, detector, detector_id, sensor, label, strength NULLS FIRST, size NULLS FIRST

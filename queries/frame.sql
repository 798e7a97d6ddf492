-- Everything that is known of one frame, one row a fact: auditor query frame RECORDING FRAME.
--
-- Rows stand in this order: the frame, its sensors, the verdict, the disparity error of each triple, by the robust method
-- the evidence (the checks by the votes of sensors that are not held for attacked), the score of each sensor check that
-- counts in it (those by the most cameras that took part), other causes, the next-best explanations.
--
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
-- param frame BIGINT: Number of the frame.
--
-- column part: What the fact is about: frame, sensor, verdict, error, evidence, score, cause or alternative.
-- column item: Which frame's property, sensor, property of the verdict, triple, sensor check, cause or explanation.
-- column value: What was found, in a word: a sensor's state, the verdict, the sensors, the element e of a triple.
-- column measured: What was measured: the gap, the disparity error E, the statistic of a sensor check, the score of a cause, the probability of an explanation (by the paper's method how much worse it is); NULL where it was not.
-- column theta: The threshold that it is compared with, of a statistic that at which z is the limit; NULL where there is none.
-- column score: The score z of the statistic.
-- column note: What else is known of it, in words.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
WITH wanted AS (
    SELECT measurement.measurement_id, measurement.rig_id, measurement.name, recording.clock
    FROM measurements AS measurement
    JOIN recordings AS recording USING (recording_id)
    WHERE $recording IS NULL OR measurement.name = $recording OR starts_with(recording_id, $recording)
),
whole AS (
    SELECT frame.*, wanted.clock, wanted.rig_id FROM frames AS frame JOIN wanted USING (measurement_id)
    WHERE frame = $frame
),
judged AS (
    SELECT
        whole.measurement_id,
        verdict.* EXCLUDE (measurement_id),
        judgement.largest_ratio,
        list_filter(list_transform(rig.sensors, lambda s: s['sensor']), lambda s: NOT list_contains(out_of_system, s))
            AS system
    FROM whole
    JOIN rigs AS rig USING (rig_id)
    LEFT JOIN verdicts AS verdict USING (measurement_id, frame)
    LEFT JOIN judgements AS judgement ON judgement.judgement_id = verdict.judgement_id
    WHERE whole.skipped IS NULL
),
fact AS (
    SELECT measurement_id, 1 AS place, 0 AS row, 'frame' AS part, unnest([
        {
            item: 'time',
            value: CASE
                WHEN clock = 'utc' THEN strftime(make_timestamp_ns(stamp_ns), '%Y-%m-%d %H:%M:%S.%g UTC')
                ELSE format('{:.3f} s', stamp_ns / 1e9)
            END,
            measured: NULL::DOUBLE,
            theta: NULL::DOUBLE,
            score: NULL::DOUBLE,
            note: 'stamp ' || stamp_ns || ' ns'
        },
        {
            item: 'skipped',
            value: CASE WHEN skipped IS NULL THEN 'no' ELSE 'yes' END,
            measured: NULL,
            theta: NULL,
            score: NULL,
            note: skipped || coalesce(' (S_' || skipped_sensor || ')', '')
        }
    ]) AS entry
    FROM whole
    UNION ALL
    SELECT measurement_id, 1, 1, 'frame', {
        item: 'labels',
        value: CASE WHEN labelled THEN sensors_in_words(truth, 'no attack') END,
        measured: NULL,
        theta: NULL,
        score: NULL,
        note: CASE WHEN NOT labelled THEN 'the recording has no labels' END
    }
    FROM truth WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 2, sensor, 'sensor', {
        item: 'S_' || sensor || ' ' || name,
        value: state,
        measured: NULL,
        theta: NULL,
        score: NULL,
        note: nullif(concat_ws(
            ', ',
            state_reason,
            format('skew {:+.1f} ms', skew_ns / 1e6),
            format('{:.1f} % saturated', 100 * saturated_share),
            format('{:.1f} % without texture', 100 * textureless_share),
            format('{:.1f} % unmatched', 100 * unmatched_share),
            format('{} points', returns)
        ), '')
    }
    FROM sensors WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 3, 0, 'verdict', unnest([
        {
            item: 'kind',
            value: kind,
            measured: NULL,
            theta: NULL,
            score: NULL,
            note: CASE WHEN kind IS NULL THEN 'not judged' ELSE reason END
        },
        {
            item: 'attacked',
            value: CASE WHEN kind = 'attacked' THEN sensors_in_words(attacked, NULL) END,
            measured: NULL,
            theta: NULL,
            score: NULL,
            note: NULL
        },
        {
            item: 'reached with',
            value: CASE WHEN kind IS NOT NULL THEN sensors_in_words(system, 'no sensor') END,
            measured: NULL,
            theta: NULL,
            score: NULL,
            note: 'without ' || nullif(sensors_in_words(out_of_system, ''), '')
        },
        {
            item: 'gap',
            value: NULL,
            measured: gap,
            theta: NULL,
            score: NULL,
            note: CASE
                WHEN gap IS NULL THEN NULL
                WHEN method = 'robust' THEN 'so much z above the next sensor or the limit; of a clean frame below it'
                ELSE 'the smallest distance of an E from its theta'
            END
        },
        {
            item: 'probability',
            value: NULL,
            measured: posterior,
            theta: NULL,
            score: NULL,
            note: CASE WHEN posterior IS NOT NULL THEN 'of the likeliest attack set, at even odds before' END
        },
        {
            item: 'likelihood ratio',
            value: NULL,
            measured: pow(10, log10_ratio),
            theta: NULL,
            score: NULL,
            note: ratio_in_words(log10_ratio, largest_ratio, kind)
        },
        {
            item: 'finding',
            value: finding,
            measured: NULL,
            theta: NULL,
            score: NULL,
            note: nullif(concat_ws(
                '; ',
                CASE WHEN finding = 'attacked' THEN sensors_in_words(finding_attacked, NULL) END,
                CASE WHEN alert THEN 'an alert, no incident' END
            ), '')
        },
        {item: 'method', value: method, measured: NULL, theta: NULL, score: NULL, note: NULL}
    ])
    FROM judged
    UNION ALL
    SELECT measurement_id, 4, position, 'error', {
        item: 'E_' || i || ',' || j || ',' || k,
        value: CASE WHEN theta IS NOT NULL THEN e END,
        measured: CASE WHEN statistic = 'plain' THEN E_plain ELSE E_gated END,
        theta: theta,
        score: NULL,
        note: CASE
            WHEN statistic = 'plain' THEN format('{} of {} px inconsistent', inconsistent_px, valid_px)
            ELSE format('{} of {} px with texture inconsistent', gated_inconsistent_px, gated_valid_px)
        END
    }
    FROM errors WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 5, row, 'evidence', {
        item: line['check_name'] || ' S_' || line['i'] || coalesce(' or S_' || line['k'], ''),
        value: NULL,
        measured: NULL,
        theta: NULL,
        score: line['score'],
        note: NULL
    }
    FROM (
        SELECT measurement_id, unnest(evidence) AS line, generate_subscripts(evidence, 1) AS row
        FROM judged WHERE method = 'robust'
    )
    UNION ALL
    SELECT statistics.measurement_id, 6, position, 'score', {
        item: check_name || ' S_' || sensor || ' by ' || sensors_in_words(others, ''),
        value: NULL,
        measured: statistics.statistic,
        theta: statistic_at_limit(mean, deviation, z_limit, z_offset),
        score: z,
        note: NULL
    }
    FROM statistics
    JOIN judged ON judged.measurement_id = statistics.measurement_id
    LEFT JOIN judgements AS judgement ON judgement.measurement_id = statistics.measurement_id AND judgement.current
    WHERE statistics.frame = $frame AND (judged.kind IS NULL OR list_has_all(judged.system, list_append(others, sensor)))
    QUALIFY len(others) = max(len(others)) OVER (PARTITION BY statistics.measurement_id, check_name, sensor)
    UNION ALL
    SELECT measurement_id, 7, row, 'cause', {
        item: cause['cause'] || coalesce(' S_' || cause['sensor'], ''),
        value: NULL,
        measured: cause['score'],
        theta: NULL,
        score: NULL,
        note: cause_in_words(cause['cause'], cause['sensor'])
    }
    FROM (SELECT measurement_id, unnest(causes) AS cause, generate_subscripts(causes, 1) AS row FROM judged)
    UNION ALL
    SELECT measurement_id, 8, row, 'alternative', {
        item: sensors_in_words(alternative['attacked'], 'no attack'),
        value: NULL,
        measured: coalesce(posterior / pow(10, alternative['worse_by']), alternative['worse_by']),
        theta: NULL,
        score: NULL,
        note: CASE WHEN posterior IS NULL THEN 'worse by so much' ELSE 'its probability' END
    }
    FROM (SELECT measurement_id, posterior, unnest(alternatives) AS alternative, generate_subscripts(alternatives, 1) AS row FROM judged)
),
numbered AS (
    SELECT *, row_number() OVER (PARTITION BY measurement_id, place, row) AS line FROM fact
)
SELECT
    part,
    entry.item,
    entry.value,
    entry.measured,
    entry.theta,
    entry.score,
    entry.note,
    wanted.name,
    numbered.measurement_id
FROM numbered JOIN wanted USING (measurement_id)
ORDER BY wanted.name, numbered.measurement_id, place, row, line

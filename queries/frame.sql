-- Everything that is known of one frame, one row a fact.
--
-- param frame BIGINT: Number of the frame.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column about: What the fact is about: the frame, its verdict, a sensor, the disparity error of a triple, or the windowed ratio of a pair check.
-- column fact: Which fact.
-- column value: The fact as text; NULL where it was not measured or not judged.
WITH wanted AS (
    SELECT measurement_id, recording_id, name
    FROM measurements
    WHERE $recording IS NULL OR name = $recording OR starts_with(recording_id, $recording)
),
fact AS (
    SELECT measurement_id, 1 AS part, 0 AS place, 'frame' AS about, unnest([
        {fact: 'stamp_ns', value: CAST(stamp_ns AS VARCHAR)},
        {fact: 'skipped', value: skipped},
        {fact: 'skipped_sensor', value: CAST(skipped_sensor AS VARCHAR)}
    ]) AS entry
    FROM frames WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 1, 1, 'labels', unnest([
        {fact: 'attacked', value: CASE WHEN labelled THEN CAST(truth AS VARCHAR) END}
    ])
    FROM truth WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 2, 0, 'verdict', unnest([
        {fact: 'kind', value: kind},
        {fact: 'e', value: e},
        {fact: 'attacked', value: CAST(attacked AS VARCHAR)},
        {fact: 'named', value: CAST(named AS VARCHAR)},
        {fact: 'out_of_system', value: CAST(out_of_system AS VARCHAR)},
        {fact: 'gap', value: CAST(gap AS VARCHAR)},
        {fact: 'evidence', value: evidence_in_words(evidence)},
        {fact: 'alternatives', value: alternatives_in_words(alternatives)},
        {fact: 'causes', value: causes_in_words(causes)},
        {fact: 'finding', value: finding},
        {fact: 'finding_attacked', value: CAST(finding_attacked AS VARCHAR)},
        {fact: 'method', value: method},
        {fact: 'reason', value: reason}
    ])
    FROM verdicts WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 3, sensor, 'S_' || sensor || ' ' || name, unnest([
        {fact: 'state', value: state},
        {fact: 'state_reason', value: state_reason},
        {fact: 'skew_ns', value: CAST(skew_ns AS VARCHAR)},
        {fact: 'saturated_share', value: CAST(saturated_share AS VARCHAR)},
        {fact: 'textureless_share', value: CAST(textureless_share AS VARCHAR)},
        {fact: 'unmatched_share', value: CAST(unmatched_share AS VARCHAR)},
        {fact: 'returns', value: CAST(returns AS VARCHAR)}
    ])
    FROM sensors WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 4, position, 'E_' || i || ',' || j || ',' || k, unnest([
        {fact: 'E_plain', value: CAST(E_plain AS VARCHAR)},
        {fact: 'E_gated', value: CAST(E_gated AS VARCHAR)},
        {fact: 'theta', value: CAST(theta AS VARCHAR)},
        {fact: 'e', value: e},
        {fact: 'valid_px', value: CAST(valid_px AS VARCHAR)},
        {fact: 'inconsistent_px', value: CAST(inconsistent_px AS VARCHAR)},
        {fact: 'gated_valid_px', value: CAST(gated_valid_px AS VARCHAR)},
        {fact: 'gated_inconsistent_px', value: CAST(gated_inconsistent_px AS VARCHAR)},
        {fact: 'out_of_range_px', value: CAST(out_of_range_px AS VARCHAR)}
    ])
    FROM errors WHERE frame = $frame
    UNION ALL
    SELECT measurement_id, 5, position, check_name || ' S_' || i || ' S_' || k, unnest([
        {fact: 'ratio', value: CAST(ratio AS VARCHAR)},
        {fact: 'theta', value: CAST(theta AS VARCHAR)},
        {fact: 'z', value: CAST(z AS VARCHAR)}
    ])
    FROM ratios WHERE frame = $frame
),
numbered AS (
    SELECT *, row_number() OVER (PARTITION BY measurement_id, part, place) AS line FROM fact
)
SELECT wanted.recording_id, wanted.name, numbered.measurement_id, about, entry.fact, entry.value
FROM numbered JOIN wanted USING (measurement_id)
ORDER BY wanted.name, numbered.measurement_id, part, place, line

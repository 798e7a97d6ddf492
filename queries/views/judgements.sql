-- One row a judgement of a measurement; the latest is the current one.
--
-- column largest_ratio: The largest likelihood ratio that its rules say: what is known of clean frames carries no more.
-- column current: TRUE for the latest judgement of its measurement.
SELECT
    *,
    TRY_CAST(json_extract_string(judging_settings, '$."likelihood.clean_worth"') AS DOUBLE) AS largest_ratio,
    row_number() OVER (PARTITION BY measurement_id ORDER BY judged_at DESC, judgement_id DESC) = 1 AS current
FROM stored_judgements

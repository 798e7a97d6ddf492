-- One row a judgement of a measurement; the latest is the current one.
--
-- column current: TRUE for the latest judgement of its measurement.
SELECT *, row_number() OVER (PARTITION BY measurement_id ORDER BY judged_at DESC, judgement_id DESC) = 1 AS current
FROM stored_judgements

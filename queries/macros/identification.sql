-- Algorithm 2 on many e vectors at once, without recursion; views, queries and the user's own SQL share it.
--
-- `e` has one character a triple ('0', '1', '-' not measured); `triples` is the list of its (i, j, k) in the same order.

-- True where an attack on the sensors `attacked` explains every measured element of e (Eq. 7); NULL where it is NULL.
CREATE MACRO explains(attacked, e, triples) AS
    CASE
        WHEN attacked IS NOT NULL THEN len(list_filter(
            triples,
            lambda t, p: substr(e, p, 1) <> '-'
                AND (substr(e, p, 1) = '1') <> list_has_any(attacked, [t['i'], t['j'], t['k']])
        )) = 0
    END;

-- For each distinct (e, triples) of the table named by `patterns`: `system`, the sensors that belong to a measured
-- triple and so take part, and `named`, the attacked among them: NULL where e leaves one of them undetermined.
CREATE MACRO algorithm2(patterns) AS TABLE
WITH pattern AS MATERIALIZED (
    SELECT row_number() OVER () AS id, e, triples
    FROM (SELECT DISTINCT e, triples FROM query_table(patterns))
),
element AS MATERIALIZED (
    SELECT id, p, t.i AS i, t.j AS j, t.k AS k, substr(e, p::INTEGER, 1) AS state
    FROM (SELECT id, e, unnest(triples) AS t, generate_subscripts(triples, 1) AS p FROM pattern)
),
-- position counts from 1, so it is also the size N of the system that the sensor closes
member AS MATERIALIZED (
    SELECT id, sensor, row_number() OVER (PARTITION BY id ORDER BY sensor) AS position
    FROM (SELECT DISTINCT id, unnest([i, j, k]) AS sensor FROM element WHERE state <> '-')
),
systems AS (
    SELECT id, list(sensor ORDER BY sensor) AS system FROM member GROUP BY id
),
considered AS (
    SELECT element.* FROM element JOIN systems USING (id) WHERE list_has_all(system, [i, j, k])
),
-- each reference camera that the descent may reach: it goes on while more than four sensors remain
reference AS MATERIALIZED (
    SELECT id, k, N, coalesce(N >= 4 AND ones = (N - 1) * (N - 2) // 2, FALSE) AS all_ones, zero
    FROM (
        SELECT id, sensor AS k, position AS N FROM member JOIN systems USING (id)
        WHERE position >= 4 OR position = len(system)
    )
    LEFT JOIN (
        SELECT id, k, count_if(state = '1') AS ones, min(p) FILTER (state = '0') AS zero
        FROM considered GROUP BY id, k
    ) USING (id, k)
),
-- where the descent ends: the leftmost reference whose elements are not all 1
last_reference AS (
    SELECT id, k, zero, zero IS NULL AS open
    FROM reference WHERE NOT all_ones
    QUALIFY k = max(k) OVER (PARTITION BY id)
),
-- Lemma 2: s_k = 1 for each reference above it
by_lemma_2 AS (
    SELECT reference.id, reference.k AS sensor
    FROM reference LEFT JOIN last_reference ON last_reference.id = reference.id
    WHERE reference.k > coalesce(last_reference.k, -1)
),
-- Lemma 1: a 0 at (i0, j0, k) gives every other source camera s_i = e_{i,i0,k}, or e_{i,j0,k} where that was not measured
cleared AS (
    SELECT last_reference.id, last_reference.k, element.i AS i0, element.j AS j0
    FROM last_reference JOIN element ON element.id = last_reference.id AND element.p = last_reference.zero
),
by_lemma_1 AS (
    SELECT
        member.id,
        member.sensor,
        arg_min(state, CASE WHEN cleared.i0 IN (considered.i, considered.j) THEN 0 ELSE 1 END)
            FILTER (state <> '-') AS s
    FROM cleared
    JOIN member ON member.id = cleared.id AND sensor < cleared.k AND sensor NOT IN (i0, j0)
    LEFT JOIN considered ON considered.id = cleared.id AND considered.k = cleared.k
        AND sensor IN (considered.i, considered.j)
        AND (i0 IN (considered.i, considered.j) OR j0 IN (considered.i, considered.j))
    GROUP BY member.id, member.sensor
),
answer AS (
    SELECT id, list(sensor ORDER BY sensor) FILTER (s = '1') AS identified, coalesce(bool_or(s IS NULL), FALSE) AS open
    FROM (SELECT id, sensor, s FROM by_lemma_1 UNION ALL SELECT id, sensor, '1' FROM by_lemma_2)
    GROUP BY id
)
SELECT
    e,
    triples,
    coalesce(system, []) AS system,
    CASE
        WHEN system IS NULL OR coalesce(answer.open, FALSE) OR coalesce(last_reference.open, FALSE) THEN NULL
        ELSE coalesce(identified, [])
    END AS named
FROM pattern
LEFT JOIN systems USING (id)
LEFT JOIN last_reference USING (id)
LEFT JOIN answer USING (id);

-- The log odds of a statistic, 0 to 1, which the offset keeps finite.
CREATE MACRO log_odds(statistic, z_offset) AS ln((statistic + z_offset) / (1 - statistic + z_offset));

-- The score z of a statistic, kept between the two of z_range; NULL where any of them is.
CREATE MACRO z_score(statistic, mean, deviation, z_offset, z_range) AS
    CASE
        WHEN (log_odds(statistic, z_offset) - mean) / deviation IS NOT NULL AND z_range IS NOT NULL
            THEN least(greatest((log_odds(statistic, z_offset) - mean) / deviation, z_range[1]), z_range[2])
    END;

-- The statistic of a check whose z is the limit, between 0 and 1; NULL where any of the four is.
CREATE MACRO statistic_at_limit(mean, deviation, z_limit, z_offset) AS
    CASE
        WHEN mean + z_limit * deviation + z_offset IS NOT NULL
            THEN least(greatest((1 + 2 * z_offset) / (1 + exp(-mean - z_limit * deviation)) - z_offset, 0), 1)
    END;

-- The strongest attacks on single sensors that the robust method missed at r = 1 %: of each kind and sensor one, those of different kinds first.
--
-- All sensors of the rig judged together, by thresholds from other recordings. A case without a size has its attack's usual one, which is taken for the largest; an attack on several sensors is left out.
--
-- param most BIGINT = 6: At most so many cases.
--
-- column setup: One rig kind, one way of measuring, real or synthetic drives.
-- column kind: The rig kind in words.
-- column evaluation_id: The part of an evaluation that the case belongs to.
-- column name: The recording's name; text from outside.
-- column recording_id: The recording, taken to be clean.
-- column rig_id: The rig.
-- column experiment: What was tried: combinations, sensitivity, further, intervals or patterns.
-- column inputs: What tells apart the files that attacks were made from.
-- column seed: The seed of the draws; NULL where nothing is drawn.
-- column frame: Number of the frame within the recording.
-- column draw: Which draw of the attacks, counted from 0.
-- column attacked: The attacked sensor.
-- column attack: The kind of attack or fault.
-- column strength: Its amplitude by name or its variant.
-- column size: Its size, in its kind's unit.
-- column parameters: Everything that decides its effect, as JSON.
-- column largest_z: Largest z of the checks that count; NULL where an earlier version judged it.
-- column limit_z: The limit that z is compared with; NULL where an earlier version judged it.
WITH by_all AS (
    SELECT judged.*, evaluations.kind, evaluations.name, evaluations.inputs, evaluations.seed
    FROM case_verdicts AS judged
    JOIN evaluations USING (evaluation_id)
    WHERE left_out = 'recording' AND len(attacked) <= 1 AND judged.experiment <> 'unseen'
    QUALIFY len(system) = max(len(system)) OVER (PARTITION BY judged.rig_id)
),
strongest AS (
    SELECT *
    FROM by_all
    WHERE verdict = 'clean' AND len(attacked) = 1
    QUALIFY row_number() OVER (
        PARTITION BY attack, attacked
        ORDER BY list_position(['opaque', 'strong', 'mild'], strength) NULLS LAST, abs(size) DESC NULLS FIRST, frame,
            name, draw, evaluation_id, strength
    ) = 1
),
chosen AS (
    SELECT
        *,
        row_number() OVER (
            PARTITION BY attack
            ORDER BY list_position(['opaque', 'strong', 'mild'], strength) NULLS LAST, abs(size) DESC NULLS FIRST,
                attacked
        ) AS of_kind
    FROM strongest
    ORDER BY of_kind, experiment <> 'combinations', attack, attacked
    LIMIT $most
)
SELECT
    chosen.setup,
    chosen.kind,
    chosen.evaluation_id,
    chosen.name,
    chosen.recording_id,
    chosen.rig_id,
    chosen.experiment,
    chosen.inputs,
    chosen.seed,
    chosen.frame,
    chosen.draw,
    chosen.attacked,
    chosen.attack,
    chosen.strength,
    chosen.size,
    cases.parameters,
    chosen.largest_z,
    chosen.limit_z
FROM chosen
JOIN cases USING (evaluation_id, frame, draw, attacked)
WHERE
    cases.attack IS NOT DISTINCT FROM chosen.attack AND cases.strength IS NOT DISTINCT FROM chosen.strength
    AND cases.size IS NOT DISTINCT FROM chosen.size
ORDER BY chosen.of_kind, chosen.experiment <> 'combinations', chosen.attack, chosen.attacked

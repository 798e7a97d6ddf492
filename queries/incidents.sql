-- Incidents: runs of frames with the same attacked sensors.
--
-- param gap_s DOUBLE = 0.5: Frames of one attacked set that are no further apart than this, in seconds, are one incident.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column kind: What the verdicts are: attacked, unidentified or suspect.
-- column attacked: The attacked sensors; empty unless kind is attacked.
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column attacked_names: The recording's own names of the attacked sensors.
-- column from_ns: Stamp of the first frame.
-- column to_ns: Stamp of the last frame.
-- column seconds: Time from the first frame to the last.
-- column from_utc: When it began, where the recording's clock is UTC.
-- column frames: Number of frames with this verdict.
-- column first_frame: Number of the first frame.
-- column last_frame: Number of the last frame.
-- column strongest_frame: Number of the frame with the largest margin.
-- column strongest_margin: The largest margin of its frames.
-- column evidence: What carried it, in words: in how many of its frames, and its mean margin there.
-- column alternatives: The next-best explanations of its strongest frame, in words.
-- column causes: What else than an attack may lie behind it, in words.
WITH finding AS (
    SELECT
        *,
        lag(stamp_ns) OVER (PARTITION BY measurement_id, kind, attacked ORDER BY stamp_ns, frame) AS previous_ns
    FROM findings
    WHERE $recording IS NULL OR name = $recording OR starts_with(recording_id, $recording)
),
numbered AS (
    SELECT
        *,
        sum(CASE WHEN stamp_ns - previous_ns <= $gap_s * 1e9 THEN 0 ELSE 1 END)
            OVER (PARTITION BY measurement_id, kind, attacked ORDER BY stamp_ns, frame) AS run
    FROM finding
),
testimony AS (
    SELECT
        measurement_id,
        kind,
        attacked,
        run,
        witness_in_words(piece.witness, piece.i, piece.j, piece.k) AS witness,
        count(*) AS frames,
        avg(piece.margin) AS margin
    FROM (SELECT measurement_id, kind, attacked, run, unnest(evidence) AS piece FROM numbered)
    GROUP BY ALL
),
carried AS (
    SELECT
        measurement_id,
        kind,
        attacked,
        run,
        string_agg(
            format('{} in {} frame{} ({:+.2f})', witness, frames, CASE WHEN frames = 1 THEN '' ELSE 's' END, margin),
            ', ' ORDER BY frames * margin DESC, witness
        ) AS evidence
    FROM testimony
    GROUP BY ALL
)
SELECT
    any_value(incident.recording_id) AS recording_id,
    any_value(incident.name) AS name,
    any_value(incident.vehicle) AS vehicle,
    incident.measurement_id,
    incident.kind,
    incident.attacked,
    any_value(names_of(incident.attacked, rig.sensors)) AS attacked_names,
    min(stamp_ns) AS from_ns,
    max(stamp_ns) AS to_ns,
    (max(stamp_ns) - min(stamp_ns)) / 1e9 AS seconds,
    CASE WHEN any_value(recording.clock) = 'utc' THEN make_timestamp_ns(min(stamp_ns)) END AS from_utc,
    count(*) AS frames,
    min(frame) AS first_frame,
    max(frame) AS last_frame,
    arg_max(frame, margin) AS strongest_frame,
    max(margin) AS strongest_margin,
    any_value(carried.evidence) AS evidence,
    alternatives_in_words(arg_max(incident.alternatives, margin)) AS alternatives,
    causes_in_words(list_distinct(flatten(list(incident.causes)))) AS causes
FROM numbered AS incident
LEFT JOIN carried USING (measurement_id, kind, attacked, run)
LEFT JOIN rigs AS rig USING (rig_id)
LEFT JOIN recordings AS recording ON recording.recording_id = incident.recording_id
GROUP BY incident.measurement_id, incident.kind, incident.attacked, run
ORDER BY name, from_ns, incident.kind, incident.attacked

-- The frames worth looking at first: the strongest frame of each incident, what names a sensor and has no other cause first; then of each alert, and then frames that nothing before or after them confirms.
--
-- param most BIGINT = 20: No more frames than this.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
-- param vehicle VARCHAR = NULL: Only the recordings of this vehicle.
--
-- column place: Its place in the order, from 1.
-- column name: The recording that it is in; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column frame: Number of the frame within the recording: auditor query frame NAME FRAME tells all of it.
-- column found: What was found: the attacked sensors by their names, or the kind of the incident.
-- column grade: incident or alert, where it belongs to one; NULL of a frame that nothing confirms.
-- column frames: How many frames the incident or alert has; NULL where it belongs to none.
-- column gap: By how much z the strongest sensor exceeds the next, or the limit.
-- column evidence: What exceeded its threshold, in words, with the sensors by their names.
-- column causes: What else than an attack may lie behind it, in words.
-- column pictured: TRUE where pictures of the frame were kept.
-- column from_utc: When it was captured, where the recording's clock is UTC.
WITH candidate AS (
    SELECT
        strongest_measurement_id AS measurement_id,
        strongest_frame AS frame,
        kind,
        attacked,
        frames,
        largest_gap AS gap,
        grade
    FROM incidents
    WHERE strongest_frame IS NOT NULL AND same_as IS NULL
    UNION ALL BY NAME
    SELECT measurement_id, frame, kind, attacked, gap
    FROM verdicts
    ANTI JOIN findings USING (measurement_id, frame)
    WHERE kind IN ('attacked', 'unidentified', 'suspect')
    -- of what nothing confirms, the strongest of each recording and finding is enough
    QUALIFY row_number() OVER (
        PARTITION BY measurement_id, kind, attacked ORDER BY gap DESC NULLS LAST, frame
    ) = 1
),
ranked AS (
    SELECT
        row_number() OVER (
            ORDER BY
                list_position(['incident', 'alert'], candidate.grade) NULLS LAST,
                list_position(['attacked', 'unidentified', 'suspect'], candidate.kind),
                coalesce(list_max([cause.score FOR cause IN verdict.causes]), 0) >= 0.5,
                candidate.gap DESC NULLS LAST,
                verdict.name,
                candidate.frame,
                candidate.measurement_id,
                candidate.attacked
        ) AS place,
        verdict.name,
        verdict.vehicle,
        candidate.frame,
        finding_in_words(candidate.kind, names_of(candidate.attacked, rig.sensors)) AS found,
        candidate.grade,
        candidate.frames,
        candidate.gap,
        with_names(evidence_in_words(verdict.evidence), rig.sensors) AS evidence,
        causes_in_words(verdict.causes) AS causes,
        EXISTS (
            SELECT 1 FROM pictures
            WHERE pictures.measurement_id = candidate.measurement_id AND pictures.frame = candidate.frame
        ) AS pictured,
        utc_of(verdict.stamp_ns, recording.clock) AS from_utc,
        verdict.recording_id,
        candidate.measurement_id
    FROM candidate
    JOIN verdicts AS verdict USING (measurement_id, frame)
    JOIN rigs AS rig USING (rig_id)
    JOIN recordings AS recording ON recording.recording_id = verdict.recording_id
    WHERE ($recording IS NULL OR verdict.name = $recording OR starts_with(verdict.recording_id, $recording))
        AND ($vehicle IS NULL OR verdict.vehicle = $vehicle)
)
SELECT * FROM ranked WHERE place <= $most ORDER BY place

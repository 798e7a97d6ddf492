-- Which seconds are clean enough to train on: intervals without a finding, a gap, an absent sensor or a label of an attack nearby.
--
-- A frame counts where the current judgement calls it clean in every rig of the recording, with all sensors present.
-- A data loader takes recording, from_ns and to_ns from --format csv, json or parquet.
--
-- param least_s DOUBLE = 1: The shortest interval, in seconds.
-- param margin_s DOUBLE = 1: How far an interval stays away from every frame that is not clean, in seconds.
-- param gap_s DOUBLE = 0.5: A longer time than this between two frames ends an interval.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
-- param vehicle VARCHAR = NULL: Only the recordings of this vehicle.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column from_utc: When the interval begins, where the recording's clock is UTC.
-- column from_ns: Stamp of its first frame.
-- column to_ns: Stamp of its last frame, included.
-- column seconds: Time from the first frame to the last.
-- column frames: Its frames, of all rigs together; frames of one stamp count once.
-- column path: Where the recording lay when it was last read.
WITH frame AS (
    SELECT
        measurement.recording_id,
        frame.stamp_ns,
        frame.skipped IS NULL
            AND verdict.kind = 'clean'
            AND verdict.finding IS NULL
            AND len(list_filter(frame.state, lambda one: one <> 'present')) = 0
            AND coalesce(len(truth.truth), 0) = 0 AS clean
    FROM stored_frames AS frame
    JOIN measurements AS measurement USING (measurement_id)
    LEFT JOIN verdicts AS verdict USING (measurement_id, frame)
    LEFT JOIN truth USING (measurement_id, frame)
    WHERE frame.skipped IS DISTINCT FROM 'edge'
        AND ($recording IS NULL OR measurement.name = $recording OR starts_with(measurement.recording_id, $recording))
        AND ($vehicle IS NULL OR measurement.vehicle = $vehicle)
),
-- the frames of all rigs of a recording, each stamp once
moment AS (
    SELECT recording_id, stamp_ns, bool_and(coalesce(clean, false)) AS clean
    FROM frame
    GROUP BY recording_id, stamp_ns
),
placed AS (
    SELECT
        *,
        max(stamp_ns) FILTER (NOT clean) OVER (PARTITION BY recording_id ORDER BY stamp_ns) AS before_ns,
        min(stamp_ns) FILTER (NOT clean) OVER (PARTITION BY recording_id ORDER BY stamp_ns DESC) AS behind_ns
    FROM moment
),
kept AS (
    SELECT *, stamp_ns - lag(stamp_ns) OVER (PARTITION BY recording_id ORDER BY stamp_ns) AS step_ns
    FROM placed
    WHERE clean
        AND (before_ns IS NULL OR stamp_ns - before_ns > $margin_s * 1e9)
        AND (behind_ns IS NULL OR behind_ns - stamp_ns > $margin_s * 1e9)
),
numbered AS (
    SELECT
        *,
        count(*) FILTER (step_ns > $gap_s * 1e9) OVER (PARTITION BY recording_id ORDER BY stamp_ns) AS run,
        -- without a margin, too, what is not clean ends an interval
        before_ns AS last_unclean_ns
    FROM kept
)
SELECT
    recording.name,
    recording.vehicle,
    utc_of(min(stamp_ns), recording.clock) AS from_utc,
    min(stamp_ns) AS from_ns,
    max(stamp_ns) AS to_ns,
    (max(stamp_ns) - min(stamp_ns)) / 1e9 AS seconds,
    count(*) AS frames,
    recording.recording_id,
    recording.path
FROM numbered
JOIN recordings AS recording USING (recording_id)
GROUP BY recording.recording_id, recording.name, recording.vehicle, recording.clock, recording.path, run, last_unclean_ns
HAVING max(stamp_ns) - min(stamp_ns) >= $least_s * 1e9
ORDER BY recording.name, recording.recording_id, from_ns

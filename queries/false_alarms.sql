-- False alarms an hour by vehicle, hour of the day and light, in frames that labels say are clean.
--
-- Only recordings that carry labels, or that auditor label was told of, say which frames are clean. An incident is a
-- false alarm where no label covers a frame of it; it counts in the hour and light of its first frame.
--
-- param dark_below DOUBLE = 40: Frames whose cameras' mean level is below this, in grey levels of 255, are dark.
-- param vehicle VARCHAR = NULL: Only the recordings of this vehicle.
--
-- column vehicle: The recording's vehicle.
-- column hour_utc: Hour of the day, 0 to 23; NULL where the clock is not UTC.
-- column light: dark or bright, by the mean level of the cameras; NULL where it was not measured.
-- column recordings: How many recordings it is from.
-- column hours: Time of the frames that are known to be clean and were audited, each counted as the time to the next, at most half a second.
-- column frames: How many frames these are.
-- column false_alarms: Incidents in them.
-- column alarming_frames: Frames of these incidents.
-- column an_hour: False alarms an hour.
-- column an_hour_at_most: Upper 95 % bound of that rate.
WITH frame AS (
    SELECT
        measurement.recording_id,
        measurement.vehicle,
        frame.measurement_id,
        frame.frame,
        least(coalesce(
            lead(frame.stamp_ns) OVER (PARTITION BY frame.measurement_id ORDER BY frame.frame) - frame.stamp_ns, 0
        ), 500_000_000) AS step_ns,
        hour(utc_of(frame.stamp_ns, measurement.clock)) AS hour_utc,
        CASE WHEN list_avg(frame.level) < $dark_below THEN 'dark' WHEN list_avg(frame.level) IS NOT NULL THEN 'bright' END AS light
    FROM stored_frames AS frame
    JOIN measurements AS measurement USING (measurement_id)
    WHERE $vehicle IS NULL OR measurement.vehicle = $vehicle
),
clean AS (
    SELECT frame.*, verdict.kind
    FROM frame
    JOIN truth USING (measurement_id, frame)
    JOIN verdicts AS verdict USING (measurement_id, frame)
    WHERE truth.labelled AND len(truth.truth) = 0 AND verdict.kind <> 'not_auditable'
),
alarm AS (
    SELECT
        frame.incident_id,
        count(*) AS frames,
        arg_min({measurement: frame.measurement_id, frame: frame.frame}, {stamp: frame.stamp_ns, frame: frame.frame}) AS first
    FROM incident_frames AS frame
    JOIN truth USING (measurement_id, frame)
    GROUP BY frame.incident_id
    HAVING bool_and(truth.labelled AND len(truth.truth) = 0)
),
counted AS (
    SELECT
        clean.vehicle,
        clean.hour_utc,
        clean.light,
        count(DISTINCT clean.recording_id) AS recordings,
        sum(greatest(clean.step_ns, 0)) / 3.6e12 AS hours,
        count(*) AS frames,
        count(alarm.incident_id) AS false_alarms,
        coalesce(sum(alarm.frames), 0)::BIGINT AS alarming_frames
    FROM clean
    LEFT JOIN alarm ON alarm.first.measurement = clean.measurement_id AND alarm.first.frame = clean.frame
    GROUP BY clean.vehicle, clean.hour_utc, clean.light
)
SELECT
    *,
    false_alarms / nullif(hours, 0) AS an_hour,
    poisson_at_most(false_alarms) / nullif(hours, 0) AS an_hour_at_most
FROM counted
ORDER BY vehicle, hour_utc, light

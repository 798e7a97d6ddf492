-- Was an incident after a gap or a changed calibration? Each incident with what came before it: gaps, another rig, a clock that was set back.
--
-- param within_s DOUBLE = 10: What ended no longer than this before the incident, in seconds, is before it.
-- param gap_s DOUBLE = 0.5: A longer time than this between two measured frames is a gap.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column incident_id: The incident, as in `incidents`.
-- column name: The first recording's name; text from outside, to be escaped wherever it is shown.
-- column vehicle: The recording's vehicle.
-- column found: What was found: the attacked sensors by their names, or the kind of the incident.
-- column first_frame: Number of the first frame, within the first recording.
-- column from_utc: When it began, where the recording's clock is UTC.
-- column before: What was before it, in words; NULL where nothing was.
-- column after_gap_s: Time from the end of the last gap to the incident.
-- column gap_s: How long that gap was.
-- column after_change_s: Time from the last change of the calibration to the incident.
-- column after_start_s: Time from the recording's first frame to the incident.
-- column clock_jumps: How often the recording's stamps jumped back while it was measured.
-- column warnings: What of the rig does not fit the images and points, and what of it is not measured.
WITH incident AS (
    SELECT
        incidents.*,
        measurement.clock,
        measurement.first_stamp_ns,
        measurement.clock_jumps,
        list_concat(measurement.calibration_warnings, measurement.remarks) AS warnings
    FROM incidents
    JOIN measurements AS measurement USING (measurement_id)
    WHERE $recording IS NULL OR incidents.name = $recording OR starts_with(incidents.recording_id, $recording)
),
-- what a frame of the same sensors had before it, up to the incident's first
step AS (
    SELECT
        incident.incident_id,
        (incident.from_ns - step.stamp_ns) / 1e9 AS after_s,
        CASE WHEN step.step_ns > $gap_s * 1e9 THEN step.step_ns / 1e9 END AS gap_s,
        step.recalibrated
    FROM incident
    JOIN frame_steps AS step USING (measurement_id)
    WHERE step.stamp_ns BETWEEN incident.from_ns - CAST($within_s * 1e9 AS BIGINT) AND incident.from_ns
        AND (step.recalibrated OR step.step_ns > $gap_s * 1e9)
),
before AS (
    SELECT
        incident_id,
        min(after_s) FILTER (gap_s IS NOT NULL) AS after_gap_s,
        arg_min(gap_s, after_s) FILTER (gap_s IS NOT NULL) AS gap_s,
        min(after_s) FILTER (recalibrated) AS after_change_s
    FROM step
    GROUP BY incident_id
)
SELECT
    incident.name,
    incident.vehicle,
    finding_in_words(incident.kind, incident.attacked_names) AS found,
    incident.first_frame,
    incident.from_utc,
    nullif(concat_ws(
        ', ',
        format('{:.1f} s after a gap of {:.1f} s', before.after_gap_s, before.gap_s),
        format('{:.1f} s after the calibration changed', before.after_change_s),
        CASE WHEN incident.clock_jumps > 0 THEN 'the clock was set back in this recording' END
    ), '') AS before,
    before.after_gap_s,
    before.gap_s,
    before.after_change_s,
    (incident.from_ns - incident.first_stamp_ns) / 1e9 AS after_start_s,
    incident.clock_jumps,
    incident.warnings,
    incident.incident_id,
    incident.recording_id
FROM incident
LEFT JOIN before USING (incident_id)
ORDER BY incident.name, incident.from_ns, found, incident.first_frame

-- One row a calibration: how it was made, what it was tried on, and what became of it.
--
-- column state: in force, earlier (it was), or else the outcome when it was made: held, refused or candidate.
-- column kind: Its rig kind in words.
-- column made_by: The verb that made it; NULL where it came from a file or from an earlier auditor.
-- column recordings: How many recordings it was made of.
-- column in_force_since: When it came into force the last time; NULL where it never was.
WITH content AS (
    SELECT
        calibration_id,
        any_value(kind) AS kind,
        any_value(matcher) AS matcher,
        any_value(counting_version) AS counting_version,
        any_value(calibrated_at) AS made_at,
        len(any_value(recordings)) AS recordings
    FROM stored_calibrations
    GROUP BY calibration_id
),
history AS (
    SELECT calibration_id, bool_or(in_force) AS in_force, max(moved_at) AS in_force_since
    FROM calibration_history
    GROUP BY calibration_id
)
SELECT
    content.calibration_id,
    CASE
        WHEN history.in_force THEN 'in force'
        WHEN history.in_force IS NOT NULL THEN 'earlier'
        ELSE coalesce(version.outcome, 'candidate')
    END AS state,
    content.kind,
    content.matcher,
    content.counting_version,
    content.recordings,
    content.made_at,
    version.* EXCLUDE (calibration_id, kind, matcher, counting_version, made_at),
    history.in_force_since
FROM content
LEFT JOIN stored_calibration_versions AS version USING (calibration_id)
LEFT JOIN history USING (calibration_id)

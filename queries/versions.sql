-- The calibrations of a store: which is in force for each rig kind, and how each was made. Those in force come first.
--
-- param calibration VARCHAR = NULL: Only the calibration whose id begins so.
--
-- column state: in force, earlier (it was), held, refused or candidate.
-- column kind: The rig kind in words.
-- column matcher: The stereo matcher that its samples were measured with.
-- column recordings: How many recordings it was made of.
-- column frames: Its clean frames.
-- column made_at: When it was made, by the machine's clock; it decides nothing.
-- column made_by: The verb that made it; NULL where it came from a file or from an earlier auditor.
-- column r: The designated false-alarm rate of the rates by others.
-- column by_others: Share of its clean frames that are not clean when other recordings judge them, at r.
SELECT
    calibration_id,
    state,
    provisional,
    kind,
    matcher,
    recordings,
    frames,
    made_at,
    made_by,
    parent,
    r,
    findings_by_others / nullif(frames_by_others, 0) AS by_others,
    resolves_r,
    reasons
FROM calibration_versions
WHERE $calibration IS NULL OR starts_with(calibration_id, $calibration)
ORDER BY kind, matcher, state <> 'in force', made_at DESC, calibration_id

-- The calibrations of a store: which is in force for each rig kind, and how each was made. Those in force come first.
--
-- param calibration VARCHAR = NULL: Only the calibration whose id begins so.
--
-- column state: in force, earlier (it was), held, refused or candidate.
-- column kind: The rig kind in words.
-- column held_out: Share of its clean frames that are not clean when other recordings judge them, at r.
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
    held_out_findings / nullif(held_out_frames, 0) AS held_out,
    resolves_r,
    reasons
FROM calibration_versions
WHERE $calibration IS NULL OR starts_with(calibration_id, $calibration)
ORDER BY kind, matcher, state <> 'in force', made_at DESC, calibration_id

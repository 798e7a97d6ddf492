-- One row a finished part of an evaluation: one experiment on one stretch of a recording.
--
-- column kind: The rig kind in words.
-- column setup: What its counts may be pooled with: made alike, on one rig kind, of real or of synthetic drives.
SELECT
    evaluation.*,
    rig.kind,
    setup_of(rig.kind, synthetic, matcher, settings, counting_version) AS setup
FROM stored_evaluations AS evaluation
JOIN stored_rigs AS rig USING (rig_id)

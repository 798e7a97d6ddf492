-- One row a finished part of the object-level baseline: one experiment on one chunk of a recording.
--
-- Where one seed attacked a chunk more than once, oftener or in more frames, the part with the most attacks, so that nothing counts twice.
--
-- column kind: The rig kind in words.
-- column setup: What it belongs to: the setup of evaluations that were made alike, on one rig kind, of real or of synthetic drives.
-- column detector_id: What its objects may be pooled with: the same networks with the same descriptions.
SELECT
    evaluation.*,
    rig.kind,
    setup_of(rig.kind, synthetic, matcher, settings, counting_version, experiments_version) AS setup,
    left(md5(detector_settings), 8) AS detector_id
FROM stored_object_evaluations AS evaluation
JOIN rigs AS rig USING (rig_id)
QUALIFY row_number() OVER (
    PARTITION BY recording_id, rig_id, matcher, settings, counting_version, experiments_version, detector_settings,
        experiment, seed, labels, chunk
    ORDER BY coalesce(draws, 1) / attack_every DESC, evaluation_id
) = 1

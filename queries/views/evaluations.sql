-- One row a finished part of an evaluation: one experiment on one chunk of a recording.
--
-- Where one seed attacked a chunk more than once, oftener or in more frames, the part with the most attacks, so that nothing counts twice.
--
-- column kind: The rig kind in words.
-- column setup: What its counts may be pooled with: made alike, on one rig kind, of real or of synthetic drives.
SELECT
    evaluation.*,
    rig.kind,
    setup_of(rig.kind, synthetic, matcher, settings, counting_version, experiments_version) AS setup
FROM stored_evaluations AS evaluation
JOIN rigs AS rig USING (rig_id)
QUALIFY row_number() OVER (
    PARTITION BY recording_id, rig_id, matcher, settings, counting_version, experiments_version, experiment, seed, inputs,
        chunk
    ORDER BY coalesce(draws, 1) / attack_every DESC, evaluation_id
) = 1

-- One row a rig.
--
-- column kind: The rig kind in words: those of the first rig, by its id, that is of the same kind.
SELECT rig.* REPLACE (coalesce(same.kind, rig.kind) AS kind)
FROM stored_rigs AS rig
LEFT JOIN (
    SELECT rig.rig_id, min_by(other.kind, other.rig_id) AS kind
    FROM stored_rigs AS rig
    JOIN stored_rigs AS other ON kinds_match(rig.rig_kind, other.rig_kind)
    GROUP BY rig.rig_id
) AS same USING (rig_id)

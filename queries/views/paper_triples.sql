-- One row a triple of the paper's reference cameras, in the order of e: all triples but the fallback.
--
-- column position: Place in e, counted from 1.
-- column i: First source camera, 0 where it is the LiDAR.
-- column j: Second source camera, i < j.
-- column k: Reference camera, j < k.
SELECT * EXCLUDE (fallback) FROM stored_triples WHERE NOT coalesce(fallback, FALSE)

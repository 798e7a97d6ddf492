-- One row a measured triple of a rig, in the order of the lists of `frames`; that of e without the fallback.
SELECT * REPLACE (coalesce(fallback, FALSE) AS fallback) FROM stored_triples

-- One row a triple of the paper's reference cameras, in the order of e: all triples but the fallback.
--
-- column position: Place in e, counted from 1.
SELECT * EXCLUDE (fallback) FROM stored_triples WHERE NOT coalesce(fallback, FALSE)

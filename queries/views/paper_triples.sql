-- One row a triple of the paper's reference cameras, in the order of e: all triples but the fallback.
SELECT * EXCLUDE (fallback) FROM stored_triples WHERE NOT coalesce(fallback, FALSE)

-- One row a triple of a rig, in the order of e.
SELECT * FROM stored_triples

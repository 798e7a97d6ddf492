-- One row a rig.
SELECT * FROM stored_rigs

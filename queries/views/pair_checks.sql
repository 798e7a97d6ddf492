-- One row an element of a rig, in the order of the local ratios.
SELECT * FROM stored_pair_checks

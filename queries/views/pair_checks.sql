-- One row a pair check of a rig, in the order of the windowed ratios.
SELECT * FROM stored_pair_checks

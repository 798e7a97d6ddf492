-- One row a measured frame and pair check that counts pixels, on a grid of cells of 8 x 8 px.
--
-- column frame: Number of the frame within the recording.
-- column position: The pair check's place among the rig's pair checks, counted from 1.
-- column check_name: Which check: lidar_conflict or photometric_inconsistency.
-- column i: First camera of the pair.
-- column k: Second camera of the pair, whose image the grid is of.
-- column rows: Rows of the grid.
-- column columns: Columns of the grid.
-- column valid: By cell, row by row: LiDAR points (lidar_conflict) or half-resolution pixels (photometric_inconsistency) that could be compared.
-- column inconsistent: By cell, row by row: those of them that are inconsistent.
SELECT
    cells.measurement_id,
    cells.frame,
    cells.position,
    pair_check.check_name,
    pair_check.i,
    pair_check.k,
    cells.rows,
    cells.columns,
    counts_of(cells.valid) AS valid,
    counts_of(cells.inconsistent) AS inconsistent
FROM stored_cells AS cells
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN stored_pair_checks AS pair_check ON pair_check.rig_id = measurement.rig_id AND pair_check.position = cells.position

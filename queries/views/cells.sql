-- One row a measured frame and element that counts pixels, on a grid of cells of 8 x 8 px.
--
-- column frame: Number of the frame within the recording.
-- column position: The element's place among the rig's elements, counted from 1.
-- column check_name: Who says something: contradicted or unlike.
-- column i: First camera of the pair.
-- column k: Second camera of the pair, whose image the grid is of.
-- column rows: Rows of the grid.
-- column columns: Columns of the grid.
-- column valid: By cell, row by row: LiDAR points (contradicted) or half-resolution pixels (unlike) that could be looked at.
-- column against: By cell, row by row: those of them that stand against somebody.
SELECT
    cells.measurement_id,
    cells.frame,
    cells.position,
    element.check_name,
    element.i,
    element.k,
    cells.rows,
    cells.columns,
    counts_of(cells.valid) AS valid,
    counts_of(cells.against) AS against
FROM stored_cells AS cells
JOIN stored_measurements AS measurement USING (measurement_id)
JOIN stored_pair_checks AS element ON element.rig_id = measurement.rig_id AND element.position = cells.position

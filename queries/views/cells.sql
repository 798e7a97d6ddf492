-- One row a measured frame and grid of counts: a check of a camera pair on the image of one of the two, or of the LiDAR's directions.
--
-- column frame: Number of the frame within the recording.
-- column check_name: Which check, see the view checks; added_light counts removed light with the other sign.
-- column i: First camera of the pair.
-- column k: Second camera of the pair.
-- column sensor: Whose grid it is: camera i or k, cells of 8 x 8 px of its image; 0 of those that count by the LiDAR's directions, cells of these.
-- column rows: Rows of the grid.
-- column columns: Columns of the grid.
-- column valid: By cell, row by row: LiDAR points (lidar_conflict, parallax_conflict), samples of the surfaces that both cameras see (lost_returns), or half-resolution pixels that could be compared, 127 at most.
-- column total: By cell, row by row: how many of them are inconsistent, or of lost_returns have no return; of added_light and coloured_light the sum of their residuals, -1 to 1 each, in steps of 1/7.
SELECT
    cells.measurement_id,
    cells.frame,
    cells.check_name,
    cells.i,
    cells.k,
    cells.sensor,
    cells.rows,
    cells.columns,
    counts_of(cells.valid) AS valid,
    signed_counts_of(cells.total) AS total
FROM stored_cells AS cells

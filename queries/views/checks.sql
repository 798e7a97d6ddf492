-- One row a check of the robust method, as it is declared: a statistic of a sensor by others.
--
-- column check_name: Its name in other views.
-- column label: Its name for readers.
-- column sensor: The sort of sensor that it checks: LiDAR or camera.
-- column others: By which other sensors.
-- column says: What it says where it fires.
-- column counted: What is counted on grids (see cells), or the statistic itself.
-- column position: Its place in all lists of checks, counted from 1.
SELECT check_name, label, sensor, others, says, counted, position
FROM (SELECT unnest(declared_checks(), recursive := true))

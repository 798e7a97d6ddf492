-- One row a sensor check of a rig, in the order of the statistics.
SELECT * FROM stored_sensor_checks

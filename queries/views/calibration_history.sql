-- One row a time that a version came into force for a rig kind and procedure.
--
-- column in_force: TRUE where it is in force: the last of its history.
SELECT *, number = max(number) OVER (PARTITION BY history_id) AS in_force FROM stored_calibration_history

-- One row a condition that recordings of a calibration were made under, with how often others raise them there.
SELECT * FROM stored_calibration_conditions

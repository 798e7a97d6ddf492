-- One row a recording that a calibration was made of, or that was looked at and left out of it.
SELECT * FROM stored_calibration_recordings

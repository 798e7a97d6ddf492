-- One row a frame or skipped tick of a finished measurement.
SELECT * FROM stored_frames

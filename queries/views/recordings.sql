-- One row a recording.
SELECT * FROM stored_recordings

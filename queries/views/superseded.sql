-- One row a recording of which another holds every frame: what was found in it is counted there.
--
-- `recordings`, `measurements`, `balance` and `verdicts`, and the queries over them, leave such recordings out.
--
-- column name: The recording's name; text from outside, to be escaped wherever it is shown.
SELECT recording_id, name, superseded_by FROM stored_recordings WHERE superseded_by IS NOT NULL

-- What the incident report draws of a measurement by the robust method: the scores of all sensor checks, frame by frame.
--
-- param measurement VARCHAR: The measurement.
--
-- column frame: Number of the frame within the recording.
-- column z: By sensor check: its score by the current judgement; NULL where it was not measured or not judged.
SELECT frame, list(z ORDER BY position) AS z
FROM statistics
WHERE measurement_id = $measurement
GROUP BY frame
ORDER BY frame

-- One row a picture that was kept: what a camera saw in a frame, or the mask of a frame's inconsistent pixels.
--
-- column frame: Number of the frame within the recording.
-- column sensor: The camera that saw it; of a mask the reference camera over whose picture it lies.
-- column content: view (a JPEG of what the camera saw) or mask (a PNG of the inconsistent pixels, transparent elsewhere).
-- column file: Its path within the folder of the store.
WITH picture AS (
    SELECT file, regexp_extract(file, '^pictures/([0-9a-f]+)/([0-9]+)_S([0-9]+)[.](jpg|png)$', ['id', 'frame', 'sensor', 'form']) AS part
    FROM stored_pictures
)
SELECT
    part.id AS measurement_id,
    measurement.recording_id,
    CAST(part.frame AS BIGINT) AS frame,
    CAST(part.sensor AS TINYINT) AS sensor,
    CASE part.form WHEN 'jpg' THEN 'view' ELSE 'mask' END AS content,
    file
FROM picture
JOIN stored_measurements AS measurement ON measurement.measurement_id = part.id
ANTI JOIN superseded USING (recording_id)
-- the mask is written last: without it the pictures of a frame are not finished
QUALIFY bool_or(part.form = 'png') OVER (PARTITION BY part.id, part.frame)

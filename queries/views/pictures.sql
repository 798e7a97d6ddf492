-- One row a picture that was kept: of the strongest frames while measuring, and of the frames that show incidents (`incident_examples`) once they are judged.
--
-- column frame: Number of the frame within the recording.
-- column sensor: The camera that saw it, 0 for the LiDAR's cloud; of a mask the reference camera over whose picture it lies.
-- column content: While measuring: view (a small JPEG of what the camera saw) or mask (a PNG of the inconsistent pixels, transparent elsewhere). Of incidents, at full resolution: colour (what the camera recorded), overlay (with what is damaged), above (the cloud from above) or range (the cloud as a range image).
-- column file: Its path within the folder of the store.
WITH picture AS (
    SELECT
        file,
        regexp_extract(
            file,
            '^pictures/([0-9a-f]+)/([0-9]+)_S([0-9]+)[.]((colour|overlay|above|range)[.])?(jpg|png)$',
            ['id', 'frame', 'sensor', 'dotted', 'content', 'form']
        ) AS part
    FROM stored_pictures
)
SELECT
    part.id AS measurement_id,
    measurement.recording_id,
    CAST(part.frame AS BIGINT) AS frame,
    CAST(part.sensor AS TINYINT) AS sensor,
    CASE WHEN part.content <> '' THEN part.content WHEN part.form = 'jpg' THEN 'view' ELSE 'mask' END AS content,
    file
FROM picture
JOIN stored_measurements AS measurement ON measurement.measurement_id = part.id
ANTI JOIN superseded USING (recording_id)
-- the mask is written last: without it the small pictures of a frame are not finished
QUALIFY part.content <> ''
    OR bool_or(part.form = 'png') OVER (PARTITION BY part.id, part.frame, part.content = '')

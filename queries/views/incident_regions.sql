-- One row an incident, attacked sensor and camera view: the middle box of what was damaged, as shares of the image.
--
-- column incident_id: The incident, as in `incidents`.
-- column sensor: The attacked sensor.
-- column view: The camera whose image the box lies in: the sensor itself, or a reference camera for the LiDAR.
-- column frames: In how many of its frames a region of the sensor was found.
-- column left_share: Left edge of the box, as a share of the image's width: the median over the frames.
-- column top_share: Upper edge, as a share of the image's height.
-- column right_share: Right edge.
-- column bottom_share: Lower edge.
SELECT
    frame.incident_id,
    region.sensor,
    region.view,
    count(*) AS frames,
    median(region.left_px / rig.rig_kind.widths_px[region.view]) AS left_share,
    median(region.top_px / rig.rig_kind.heights_px[region.view]) AS top_share,
    median(region.right_px / rig.rig_kind.widths_px[region.view]) AS right_share,
    median(region.bottom_px / rig.rig_kind.heights_px[region.view]) AS bottom_share
FROM incident_frames AS frame
JOIN stored_regions AS region
    ON region.measurement_id = frame.measurement_id
        AND region.frame = frame.frame
        AND list_contains(frame.attacked, region.sensor)
        AND region.right_px > 0
JOIN stored_measurements AS measurement ON measurement.measurement_id = frame.measurement_id
JOIN rigs AS rig USING (rig_id)
GROUP BY frame.incident_id, region.sensor, region.view

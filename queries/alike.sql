-- Which incidents look alike: pairs in which the same kind of sensor was attacked at the same place in the image and over the same size. It may be one attacker.
--
-- param overlap DOUBLE = 0.5: How much the two boxes have in common: the area of both over the area of either, 0 to 1.
-- param recording VARCHAR = NULL: Only pairs with an incident of the recording of this name, or whose id begins so.
--
-- column overlap: What the two boxes have in common, 1 for the same box.
-- column incident_id: The incident, as in `incidents`.
-- column name: The recording of the earlier incident; text from outside, to be escaped wherever it is shown.
-- column vehicle: Its vehicle.
-- column first_frame: Number of its first frame.
-- column sensor: Its attacked sensor: 0 the LiDAR, else a camera.
-- column other_incident_id: The later incident, as in `incidents`.
-- column other_name: The recording of the later incident; text from outside, to be escaped wherever it is shown.
-- column other_vehicle: Its vehicle.
-- column other_first_frame: Number of its first frame.
-- column other_sensor: Its attacked sensor.
-- column at: The middle of the earlier one's box, across and down, as shares of the image.
-- column size: Its width and height, as shares of the image.
-- column other_at: The middle of the later one's box.
-- column other_size: Its width and height.
-- column apart_s: Time between their beginnings, where both clocks are UTC.
-- column apart_m: Distance between their beginnings, where both have GPS fixes.
WITH box AS (
    SELECT
        region.*,
        incident.name,
        incident.vehicle,
        incident.first_frame,
        incident.from_ns,
        incident.from_utc,
        incident.recording_id,
        place.latitude_deg,
        place.longitude_deg,
        (right_share - left_share) * (bottom_share - top_share) AS area
    FROM incident_regions AS region
    JOIN incidents AS incident USING (incident_id)
    LEFT JOIN places AS place
        ON place.measurement_id = incident.measurement_id AND place.frame = incident.first_frame
),
pair AS (
    SELECT
        a,
        b,
        greatest(least(a.right_share, b.right_share) - greatest(a.left_share, b.left_share), 0)
            * greatest(least(a.bottom_share, b.bottom_share) - greatest(a.top_share, b.top_share), 0) AS common
    FROM box AS a
    JOIN box AS b
        ON (a.from_ns, a.incident_id) < (b.from_ns, b.incident_id)
            AND (a.sensor = 0) = (b.sensor = 0)
)
SELECT
    common / (a.area + b.area - common) AS overlap,
    a.name AS name,
    a.vehicle AS vehicle,
    a.first_frame AS first_frame,
    a.sensor AS sensor,
    b.name AS other_name,
    b.vehicle AS other_vehicle,
    b.first_frame AS other_first_frame,
    b.sensor AS other_sensor,
    [round((a.left_share + a.right_share) / 2, 3), round((a.top_share + a.bottom_share) / 2, 3)] AS at,
    [round(a.right_share - a.left_share, 3), round(a.bottom_share - a.top_share, 3)] AS size,
    [round((b.left_share + b.right_share) / 2, 3), round((b.top_share + b.bottom_share) / 2, 3)] AS other_at,
    [round(b.right_share - b.left_share, 3), round(b.bottom_share - b.top_share, 3)] AS other_size,
    CASE WHEN a.from_utc IS NOT NULL AND b.from_utc IS NOT NULL THEN (b.from_ns - a.from_ns) / 1e9 END AS apart_s,
    metres_apart(a.latitude_deg, a.longitude_deg, b.latitude_deg, b.longitude_deg) AS apart_m,
    a.incident_id AS incident_id,
    b.incident_id AS other_incident_id
FROM pair
WHERE common > 0
    AND common / (a.area + b.area - common) >= $overlap
    AND (
        $recording IS NULL
        OR $recording IN (a.name, b.name)
        OR starts_with(a.recording_id, $recording)
        OR starts_with(b.recording_id, $recording)
    )
-- the LiDAR's region lies in several views: the pair counts once, by what they have most in common
QUALIFY row_number() OVER (
    PARTITION BY a.incident_id, b.incident_id, a.sensor, b.sensor ORDER BY common / (a.area + b.area - common) DESC, a.view, b.view
) = 1
ORDER BY overlap DESC, a.from_ns, a.incident_id, b.from_ns, b.incident_id, sensor, other_sensor

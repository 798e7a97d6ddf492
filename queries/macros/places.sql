-- Places and times.

-- Metres between two places by latitude and longitude in degrees, on a sphere of the Earth's mean radius (haversine).
CREATE MACRO metres_apart(latitude, longitude, other_latitude, other_longitude) AS
    2 * 6_371_009 * asin(least(1, sqrt(
        sin(radians(other_latitude - latitude) / 2) ** 2
        + cos(radians(latitude)) * cos(radians(other_latitude)) * sin(radians(other_longitude - longitude) / 2) ** 2
    )));

-- The time of day of a stamp, where the recording's clock is UTC.
CREATE MACRO utc_of(stamp_ns, clock) AS CASE WHEN clock = 'utc' THEN make_timestamp_ns(stamp_ns) END;

-- What was found, in words: attacked sensors by their names, or the kind.
CREATE MACRO finding_in_words(kind, attacked_names) AS
    CASE WHEN kind = 'attacked' THEN 'attacked: ' || array_to_string(attacked_names, ' and ') ELSE kind END;

-- What stays of an incident when it is measured or judged anew.

-- TRUE where two findings are of one incident: their recordings or drives have one in common, they overlap in time, and
-- they name the same sensors.
CREATE MACRO is_one_incident(recordings, sensors, from_ns, to_ns, other_recordings, other_sensors, other_from_ns, other_to_ns) AS
    list_has_any(recordings, other_recordings)
    AND list_sort(sensors) = list_sort(other_sensors)
    AND from_ns <= other_to_ns
    AND other_from_ns <= to_ns;

-- The name of an incident that begins with a frame: what it hashes is content, and no verdict.
CREATE MACRO name_of_incident(recording_id, rig_id, matcher, stamp_ns) AS
    md5(concat_ws(' ', recording_id, rig_id, matcher, stamp_ns));

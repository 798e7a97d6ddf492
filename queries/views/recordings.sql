-- One row a recording, with the drive that it is part of and where its messages went.
--
-- Recordings are of one drive where that was given (one vehicle, one name of a drive), or where they are of one
-- vehicle, with the same rigs and clock, and each begins within 10 s of the end of the one before. A relative clock
-- does not show whether recordings follow each other.
--
-- column drive_id: The recording that the drive begins with.
-- column messages_read: Messages read by its latest measurement: used + unused + damaged + skipped.
-- column messages_used: Those that became part of a frame.
-- column messages_unused: Those that no frame wanted.
-- column messages_damaged: Those that could not be decoded whole.
-- column messages_skipped: Those that were left out, see the view balance for the reasons.
WITH measured AS (
    SELECT recording_id, list(DISTINCT rig_id ORDER BY rig_id) AS rigs, arg_max(balance, measured_at) AS balance
    FROM stored_measurements
    GROUP BY recording_id
),
following AS (
    SELECT
        recording.*,
        measured.rigs,
        measured.balance,
        from_ns - lag(to_ns) OVER (
            PARTITION BY vehicle, drive, clock, rigs ORDER BY from_ns, to_ns, recording_id
        ) BETWEEN -1_000_000_000 AND 10_000_000_000 AND clock <> 'relative' AS follows
    FROM stored_recordings AS recording
    ANTI JOIN superseded USING (recording_id)
    LEFT JOIN measured USING (recording_id)
),
numbered AS (
    SELECT
        *,
        CASE WHEN drive IS NULL THEN count(*) FILTER (NOT coalesce(follows, false)) OVER (
            PARTITION BY vehicle, drive, clock, rigs ORDER BY from_ns, to_ns, recording_id
        ) END AS chain
    FROM following
),
named AS (
    SELECT
        *,
        CASE
            WHEN drive IS NULL THEN first_value(recording_id) OVER (
                PARTITION BY vehicle, clock, rigs, chain, drive ORDER BY from_ns, to_ns, recording_id
            )
            ELSE first_value(recording_id) OVER (PARTITION BY vehicle, drive ORDER BY from_ns, to_ns, recording_id)
        END AS drive_id
    FROM numbered
)
SELECT
    * EXCLUDE (rigs, balance, follows, chain),
    list_sum([topic.read FOR topic IN balance]) AS messages_read,
    list_sum([topic.used FOR topic IN balance]) AS messages_used,
    list_sum([topic.unused FOR topic IN balance]) AS messages_unused,
    list_sum([topic.damaged FOR topic IN balance]) AS messages_damaged,
    list_sum([coalesce(list_sum(map_values(topic.skipped)), 0) FOR topic IN balance]) AS messages_skipped
FROM named

-- What the index of a fleet shows of a vehicle on a day: recordings, how much of them was audited, and incidents and alerts that begin in them.
--
-- column vehicle: The vehicle; NULL where it is not known.
-- column day: The day of its recordings: that which was given, or that of their clock; NULL where it is not known.
-- column recordings: Number of recordings.
-- column frames: Frames and skipped ticks, without those at the recordings' edges.
-- column audited: Those that have a verdict other than not_auditable.
-- column incomplete: Recordings of which something was not audited, by the last scan or refresh that read them: what ends in 3 or 4.
-- column incidents: Number of incidents, each once however many rigs say it, without excused ones.
-- column alerts: Number of alerts, likewise.
-- column excused: Number of both that a review calls a false alarm, or known.
SELECT
    summary.vehicle,
    coalesce(summary.date, CAST(utc_of(recording.from_ns, recording.clock) AS DATE)) AS day,
    count(DISTINCT summary.recording_id) AS recordings,
    CAST(coalesce(sum(summary.frames), 0) AS BIGINT) AS frames,
    CAST(round(coalesce(sum(summary.frames * summary.audited_share), 0)) AS BIGINT) AS audited,
    count(DISTINCT summary.recording_id) FILTER (
        summary.recording_id IN (SELECT recording_id FROM inputs WHERE len(gaps) > 0)
    ) AS incomplete,
    CAST(coalesce(sum(found.incidents), 0) AS BIGINT) AS incidents,
    CAST(coalesce(sum(found.alerts), 0) AS BIGINT) AS alerts,
    CAST(coalesce(sum(found.excused), 0) AS BIGINT) AS excused
FROM summary
JOIN recordings AS recording USING (recording_id)
LEFT JOIN (
    SELECT
        measurement_id,
        count(*) FILTER (grade = 'incident' AND NOT excused) AS incidents,
        count(*) FILTER (grade = 'alert' AND NOT excused) AS alerts,
        count(*) FILTER (excused) AS excused
    FROM (SELECT *, coalesce(review IN ('false-alarm', 'known'), false) AS excused FROM incidents)
    WHERE same_as IS NULL
    GROUP BY measurement_id
) AS found USING (measurement_id)
GROUP BY ALL
ORDER BY day NULLS FIRST, vehicle NULLS FIRST

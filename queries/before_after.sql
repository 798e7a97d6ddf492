-- What changed on a day, as by a visit to a workshop: the levels of a vehicle's sensors in the days before and from then on. The largest change comes first.
--
-- param day TIME: The first day after it, as 2026-03-04.
-- param vehicle VARCHAR = NULL: Only this vehicle.
-- param days BIGINT = 14: So many days before, and as many from then on.
--
-- column vehicle: The vehicle.
-- column check_name: The check, see the view daily_levels.
-- column sensors: The sensors that are compared.
-- column unit: What levels are in.
-- column before: Median of the daily levels before.
-- column after: Median of the daily levels from the day on.
-- column change: after - before.
-- column deviations: The change over the deviation of a day's level: the median one from day to day, as of a normal distribution. Chances are those of auditor drift.
-- column days_before: How many days before have a level.
-- column days_after: How many days from then on have one.
-- column kind: The rig kind in words, and how it was measured.
WITH chosen AS (
    SELECT
        *,
        day >= CAST(make_timestamp_ns($day) AS DATE) AS later,
        abs(level - lag(level) OVER (PARTITION BY kind, vehicle, check_name, sensors ORDER BY day)) / 0.6744897501960817 / sqrt(2) AS step
    FROM daily_levels
    WHERE ($vehicle IS NULL OR vehicle = $vehicle)
        AND abs(date_diff('day', CAST(make_timestamp_ns($day) AS DATE), day) + 0.5) < $days
),
compared AS (
    SELECT
        vehicle,
        check_name,
        sensors,
        unit,
        median(level) FILTER (NOT later) AS before,
        median(level) FILTER (later) AS after,
        median(step) AS deviation,
        count(*) FILTER (NOT later) AS days_before,
        count(*) FILTER (later) AS days_after,
        kind
    FROM chosen
    GROUP BY kind, vehicle, check_name, sensors, unit
)
SELECT
    vehicle,
    check_name,
    sensors,
    unit,
    before,
    after,
    after - before AS change,
    (after - before) / nullif(deviation, 0) AS deviations,
    days_before,
    days_after,
    kind
FROM compared
WHERE before IS NOT NULL AND after IS NOT NULL
ORDER BY abs((after - before) / nullif(deviation, 0)) DESC NULLS LAST, vehicle, check_name, sensors, kind

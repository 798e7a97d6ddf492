-- Incidents of an evaluation, by all sensors: whether a second under attack, or a whole recording, is found as one, with whom and how soon, and how many false ones there are per hour of clean driving.
--
-- By the robust method incidents are those of a scan, by the paper's runs of frames with the same verdict. An attacked interval lies in an otherwise clean drive; its attack holds still or is drawn anew for every frame, and its faculas are mild. A lasting attack holds still in all frames of a recording, where each one is attacked (--attack-every 1), and is one interval.
--
-- param r RATE[] = 0.01: The designated false-alarm rates.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
-- param gap_s DOUBLE = 0.5: Frames with the same verdict that are no further apart than this, in seconds, are one incident.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column system: The sensors that took part: all.
-- column attacked: The attacked sensors; empty for clean drives.
-- column variant: still, moving or lasting; NULL for clean drives.
-- column r: The designated false-alarm rate.
-- column samples: The smallest number N of clean samples that a theta came from; NULL by the robust method.
-- column drives: The smallest number of clean recordings that thresholds came from; 0 where they are the robust method's prior.
-- column resolvable: FALSE where 0 < r < 1/N for some theta of the paper's method: it is then the maximum of its N samples.
-- column frames: Frames, attacked or clean.
-- column incidents: Incidents in them.
-- column intervals: Attacked intervals; NULL for clean drives, as all that follows on them.
-- column found: Those with an incident.
-- column rate: found / intervals.
-- column low: Lower end of its interval.
-- column high: Upper end of its interval.
-- column named: Those whose longest incident names exactly the attacked sensors.
-- column naming_rate: named / intervals.
-- column naming_low: Lower end of its interval.
-- column naming_high: Upper end of its interval.
-- column delay_s: Median time from the first attacked frame to the first of an incident, where there is one and the clock was not set back before it, in seconds.
-- column longest_delay_s: The longest such time, in seconds.
-- column hours: Time that clean frames stand for: their number times the usual time between two; NULL where there are no two, and for intervals, as all that follows.
-- column incidents_an_hour: False incidents per hour of clean driving.
-- column at_most_an_hour: Upper 95 % bound of that, as of a Poisson process.
WITH state AS MATERIALIZED (
    SELECT *
    FROM evaluation_states(cases, paper_triples, $r, $statistic, $block_frames)
    WHERE experiment IN ('clean', 'intervals')
    QUALIFY len(system) = max(len(system)) OVER (PARTITION BY setup)
),
pattern AS MATERIALIZED (
    SELECT DISTINCT e, triples FROM state
),
answer AS MATERIALIZED (
    FROM algorithm2(pattern)
),
judged AS MATERIALIZED (
    SELECT
        state.* EXCLUDE (triples, e, attack, size),
        'paper' AS method,
        paper_verdict(state.e, state.triples, answer.system, answer.named) AS verdict,
        CASE WHEN verdict = 'attacked' THEN answer.named ELSE [] END AS identified
    FROM state
    JOIN answer ON answer.e = state.e AND answer.triples = state.triples
    UNION ALL BY NAME
    SELECT
        setup,
        rig_id,
        recording_id,
        evaluation_id,
        frame,
        stamp_ns,
        draw,
        left_out,
        system,
        experiment,
        strength,
        attacked,
        r,
        CAST(NULL AS BIGINT) AS samples,
        drives,
        TRUE AS resolvable,
        'robust' AS method,
        window_kind AS verdict,
        window_named AS identified,
        event
    FROM case_verdicts
    WHERE experiment IN ('clean', 'intervals')
        AND list_contains(CAST($r AS DECIMAL(18, 17)[]), r)
        AND (left_out <> 'block' OR $block_frames = robust_block_frames())
    QUALIFY len(system) = max(len(system)) OVER (PARTITION BY setup)
),
-- a clean drive, or one interval under one attack
placed AS MATERIALIZED (
    SELECT
        {setup: setup, method: method, left_out: left_out, system: system, attacked: attacked, variant: strength, r: r} AS what,
        CASE
            WHEN experiment = 'clean' THEN concat_ws('|', recording_id, rig_id)
            WHEN strength = 'lasting' THEN concat_ws('|', recording_id, rig_id, draw)
            ELSE concat_ws('|', evaluation_id, frame // interval_frames(), draw)
        END AS line,
        *
    FROM judged
),
-- `clock` counts how often the clock was set back before a frame: there no incident goes on
clocked AS MATERIALIZED (
    SELECT *, count(*) FILTER (step_ns < 0) OVER (PARTITION BY what, line ORDER BY frame) AS clock
    FROM (SELECT *, stamp_ns - lag(stamp_ns) OVER (PARTITION BY what, line ORDER BY frame) AS step_ns FROM placed)
),
line AS (
    SELECT
        what,
        line,
        arg_min(stamp_ns, frame) AS from_ns,
        count(*) AS frames,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable
    FROM placed
    GROUP BY what, line
),
numbered AS (
    SELECT
        *,
        sum(CASE WHEN step_ns <= $gap_s * 1e9 OR coalesce(same_event, false) THEN 0 ELSE 1 END) OVER same AS run
    FROM (
        SELECT
            what,
            line,
            clock,
            verdict,
            identified,
            frame,
            stamp_ns,
            stamp_ns - lag(stamp_ns) OVER same AS step_ns,
            -- cases are judged block by block, and events numbered anew in each
            event = lag(event) OVER same
                AND frame // robust_block_frames() = lag(frame) OVER same // robust_block_frames() AS same_event
        FROM clocked
        WHERE verdict IN ('attacked', 'unidentified', 'suspect')
        WINDOW same AS (PARTITION BY what, line, clock, verdict, identified ORDER BY frame)
    )
    WINDOW same AS (PARTITION BY what, line, clock, verdict, identified ORDER BY frame)
),
incident AS (
    SELECT what, line, clock, identified, count(*) AS frames, min(frame) AS first_frame, min(stamp_ns) AS from_ns
    FROM numbered
    GROUP BY what, line, clock, verdict, identified, run
),
found AS (
    SELECT
        line.what,
        line.frames,
        line.samples,
        line.drives,
        line.resolvable,
        count(incident.frames) AS incidents,
        list(incident.identified ORDER BY incident.frames DESC, incident.first_frame)[1] AS identified,
        (min(incident.from_ns) FILTER (incident.clock = 0) - line.from_ns) / 1e9 AS delay_s
    FROM line
    LEFT JOIN incident ON incident.what = line.what AND incident.line = line.line
    GROUP BY line.what, line.line, line.frames, line.samples, line.drives, line.resolvable, line.from_ns
),
tally AS (
    SELECT
        what,
        what['attacked'] = [] AS clean,
        min(samples) AS samples,
        min(drives) AS drives,
        bool_and(resolvable) AS resolvable,
        CAST(sum(frames) AS BIGINT) AS frames,
        CAST(sum(incidents) AS BIGINT) AS incidents,
        count(*) AS intervals,
        CAST(count_if(incidents > 0) AS BIGINT) AS found,
        CAST(count_if(coalesce(identified = what['attacked'], FALSE)) AS BIGINT) AS named,
        median(delay_s) AS delay_s,
        max(delay_s) AS longest_delay_s
    FROM found
    GROUP BY what
),
period AS (
    FROM usual_periods(cases)
)
SELECT
    what['setup'] AS setup,
    what['method'] AS method,
    what['left_out'] AS left_out,
    what['system'] AS system,
    what['attacked'] AS attacked,
    what['variant'] AS variant,
    CAST(what['r'] AS DOUBLE) AS r,
    samples,
    drives,
    resolvable,
    frames,
    incidents,
    CASE WHEN NOT clean THEN intervals END AS intervals,
    CASE WHEN NOT clean THEN found END AS found,
    CASE WHEN NOT clean THEN found / tally.intervals END AS rate,
    CASE WHEN NOT clean THEN wilson(found, tally.intervals, -1) END AS low,
    CASE WHEN NOT clean THEN wilson(found, tally.intervals, 1) END AS high,
    CASE WHEN NOT clean THEN named END AS named,
    CASE WHEN NOT clean THEN named / tally.intervals END AS naming_rate,
    CASE WHEN NOT clean THEN wilson(named, tally.intervals, -1) END AS naming_low,
    CASE WHEN NOT clean THEN wilson(named, tally.intervals, 1) END AS naming_high,
    CASE WHEN NOT clean THEN delay_s END AS delay_s,
    CASE WHEN NOT clean THEN longest_delay_s END AS longest_delay_s,
    CASE WHEN clean THEN frames * period_s / 3600 END AS hours,
    CASE WHEN clean THEN incidents / (frames * period_s / 3600) END AS incidents_an_hour,
    CASE WHEN clean THEN poisson_at_most(incidents) / (frames * period_s / 3600) END AS at_most_an_hour
FROM tally
JOIN period ON period.setup = what['setup']
ORDER BY setup, method, left_out, len(attacked), attacked, variant, r

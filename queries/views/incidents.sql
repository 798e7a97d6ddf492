-- Incidents and alerts: by the robust method the events of several frames, by the paper's runs of frames with the same attacked sensors; also from one recording of a drive into the next. Where a recording's clock is set back a new one begins.
--
-- param gap_s DOUBLE = 0.5: Events, or frames by the paper's method, of one attacked set that are no further apart than this, in seconds, are one incident.
-- param recording VARCHAR = NULL: Only the recording of this name, or whose id begins so.
--
-- column incident_id: Hash of where it begins: the first recording's content, rig and matcher, and the stamp of its first frame. It stays when the recording is judged or measured anew; a name that it had before it grew is in `incident_names`.
-- column grade: incident, or alert: findings that no incident holds, and that count as found all the same.
-- column judgement_id: The judgement of its first frame; the parts have those of the others.
-- column rig_id: The rig.
-- column drive_id: The recording that its drive begins with.
-- column kind: What the verdicts are: attacked, unidentified or suspect.
-- column attacked: The attacked sensors; empty unless kind is attacked.
-- column name: The first recording's name; text from outside, to be escaped wherever it is shown.
-- column attacked_names: The recording's own names of the attacked sensors.
-- column from_ns: Stamp of the first frame.
-- column to_ns: Stamp of the last frame.
-- column seconds: Time from the first frame to the last.
-- column from_utc: When it began, where the recording's clock is UTC.
-- column frames: Number of its frames; by the robust method those that add to its evidence.
-- column first_frame: Number of the first frame, within the first recording.
-- column last_frame: Number of the last frame, within the last recording.
-- column parts: What each recording has of it, in order.
-- column strongest_frame: Number of the frame with the largest gap, of those whose own verdict is that of the incident, or is of its kind where there are none.
-- column strongest_name: The recording that it is in.
-- column strongest_measurement_id: The measurement that it is of, as in `regions`, `pictures` and `verdicts`.
-- column largest_gap: The gap of its strongest frame: by how much z the strongest sensor exceeds the next, or the limit.
-- column evidence: What exceeded its threshold, in words: in how many of its frames, and its mean score there. Where no frame is a finding by itself, that evidence below its limit lasted; where frames are one of another kind, that it lasted carries the incident.
-- column weak: No frame is a finding by itself: evidence below its limit lasted.
-- column shares: How much of the evidence speaks for what, in words: what the verdicts on its frames are, each by itself.
-- column alternatives: The next-best explanations of its strongest frame, in words, with probabilities that weigh how likely each was before as well; NULL where that frame names other sensors than the incident.
-- column posterior: The largest probability of the likeliest attack set in one of its frames, at even odds before; NULL by the paper's method.
-- column log10_ratio: The decimal logarithm of the largest likelihood ratio of an attack set against no attack in one of its frames.
-- column ratio: That ratio in words, and how much support it is (ENFSI 2015).
-- column causes: What else than an attack may lie behind it, in words; of what lasts, that it explains frames by themselves alone.
-- column same_as: The incident of another rig of its recording that says the same, of all of its time, the stronger of the two: that names the same sensors, or names what this one cannot by findings of its own frames, or has such findings where this one names by weak evidence alone; NULL where this one stands by itself.
-- column review: What somebody said of it (auditor review), or else of the incident that says the same: confirmed, false-alarm or known; NULL where nobody did, or where the review no longer counts.
-- column review_reason: Why, in the reviewer's own words.
-- column reviewed_seconds: How long the incident was when that was said; it may have grown since.
WITH placed AS MATERIALIZED (
    SELECT
        measurement.measurement_id,
        measurement.matcher,
        measurement.measured_at,
        recording.drive_id,
        recording.clock,
        rig.sensors,
        dense_rank() OVER (
            ORDER BY recording.drive_id, [sensor.topic FOR sensor IN rig.sensors], measurement.matcher,
                measurement.settings, measurement.counting_version
        ) AS series,
        dense_rank() OVER (ORDER BY recording.from_ns, measurement.recording_id) AS place,
        measurement.recording_id,
        recording.from_ns,
        recording.to_ns,
        $recording IS NULL OR recording.name = $recording OR starts_with(recording.recording_id, $recording) AS wanted
    FROM measurements AS measurement
    JOIN recordings AS recording USING (recording_id)
    JOIN rigs AS rig USING (rig_id)
),
line AS (
    -- One drive, its sensors and procedure: what runs from one recording into the next is one incident. A recording that begins
    -- before the one before has ended has a clock of its own.
    SELECT
        measurement_id,
        place,
        wanted,
        {series: series, clock: count(*) FILTER (coalesce(anew, false)) OVER (PARTITION BY series ORDER BY place)} AS line
    FROM (
        SELECT
            *,
            recording_id <> lag(recording_id) OVER before AND from_ns < lag(to_ns) OVER before - 1_000_000_000 AS anew
        FROM placed
        WINDOW before AS (PARTITION BY series ORDER BY place)
    )
),
step AS (
    SELECT
        measurement_id,
        frame,
        line,
        place,
        wanted,
        stamp_ns < lag(stamp_ns) OVER (PARTITION BY measurement_id ORDER BY frame) AS back
    FROM verdicts
    JOIN line USING (measurement_id)
    WHERE line IN (SELECT line FROM line WHERE wanted)
        AND line IN (SELECT line FROM line WHERE measurement_id IN (SELECT measurement_id FROM findings))
),
-- A step back within a recording: there the clock was set, and stamps on either side of it are not of one line.
timed AS (
    SELECT
        measurement_id,
        frame,
        {line: line, clock: count(*) FILTER (coalesce(back, false)) OVER (PARTITION BY line ORDER BY place, frame)} AS line,
        place,
        wanted
    FROM step
),
-- Narrow rows: what they are sorted with is carried along.
finding AS (
    SELECT
        findings.measurement_id,
        findings.frame,
        stamp_ns,
        kind,
        attacked,
        {of: timed.line, alert: findings.alert} AS line,
        timed.place,
        timed.wanted,
        judgement.largest_ratio,
        lag(stamp_ns) OVER before AS previous_ns,
        coalesce(
            event = lag(event) OVER before
                AND list_contains(
                    list_append(judgement.judged_with, measurement_id), lag(measurement_id) OVER before
                ),
            false
        ) AS same_event
    FROM findings
    JOIN timed USING (measurement_id, frame)
    JOIN (SELECT judgement_id, coalesce(judged_with, []) AS judged_with, largest_ratio FROM judgements) AS judgement
        USING (judgement_id)
    WINDOW before AS (PARTITION BY timed.line, findings.alert, kind, attacked ORDER BY place, frame)
),
run AS (
    SELECT
        measurement_id,
        frame,
        line,
        place,
        wanted,
        largest_ratio,
        sum(CASE WHEN same_event OR abs(stamp_ns - previous_ns) <= $gap_s * 1e9 THEN 0 ELSE 1 END)
            OVER (PARTITION BY line, kind, attacked ORDER BY place, frame) AS run
    FROM finding
),
numbered AS (
    SELECT * FROM findings JOIN run USING (measurement_id, frame)
),
part AS (
    SELECT
        line,
        kind,
        attacked,
        run,
        place,
        {
            recording_id: any_value(recording_id),
            name: any_value(name),
            measurement_id: measurement_id,
            judgement_id: any_value(judgement_id),
            frames: count(*),
            first_frame: min(frame),
            last_frame: max(frame),
            from_ns: min(stamp_ns),
            to_ns: max(stamp_ns)
        } AS part
    FROM numbered
    GROUP BY line, kind, attacked, run, place, measurement_id
),
whole AS (
    SELECT line, kind, attacked, run, list(part ORDER BY place, part.first_frame) AS parts
    FROM part
    GROUP BY ALL
),
-- Several views of a frame, or checks, may say the same: the frame counts once, by the strongest.
in_frame AS (
    SELECT
        line,
        kind,
        attacked,
        run,
        measurement_id,
        frame,
        check_in_words(piece.check_name, piece.i, piece.j, piece.k) AS check_name,
        max(piece.score) AS score
    FROM (SELECT line, kind, attacked, run, measurement_id, frame, unnest(evidence) AS piece FROM numbered)
    GROUP BY ALL
),
piece AS (
    SELECT line, kind, attacked, run, check_name, count(*) AS frames, avg(score) AS score
    FROM in_frame
    GROUP BY ALL
),
carried AS (
    SELECT
        line,
        kind,
        attacked,
        run,
        string_agg(
            format('{} in {} frame{} ({:+.2f})', check_name, frames, CASE WHEN frames = 1 THEN '' ELSE 's' END, score),
            ', ' ORDER BY round(frames * score, 6) DESC, check_name -- sums differ in their last bits by their order
        ) AS evidence
    FROM piece
    GROUP BY ALL
),
-- what the frames say, each by itself
said AS (
    SELECT
        line,
        kind,
        attacked,
        run,
        finding_in_words(own_kind, [format('S_{}', sensor) FOR sensor IN own_attacked]) AS own,
        sum(coalesce(event_added, 1)) AS added
    FROM numbered
    WHERE own_kind IN ('attacked', 'unidentified', 'suspect')
    GROUP BY ALL
),
shared AS (
    SELECT
        line,
        kind,
        attacked,
        run,
        string_agg(format('{} {:.0f} %', own, 100 * share), ', ' ORDER BY share DESC, own) AS shares
    FROM (SELECT *, added / nullif(sum(added) OVER (PARTITION BY line, kind, attacked, run), 0) AS share FROM said)
    GROUP BY ALL
),
grouped AS (
    SELECT
        line,
        incident.kind,
        incident.attacked,
        run,
        any_value(about.matcher) AS matcher,
        max(about.measured_at) AS measured_at,
        any_value(incident.vehicle) AS vehicle,
        any_value(about.drive_id) AS drive_id,
        any_value(incident.rig_id) AS rig_id,
        any_value(incident.alert) AS alert,
        any_value(about.sensors) AS sensors,
        any_value(about.clock) AS clock,
        min(stamp_ns) AS from_ns,
        max(stamp_ns) AS to_ns,
        count(*) AS frames,
        -- Of frames that name what the incident names, before those of its kind, before those that only its time holds; of
        -- equal gaps the last.
        arg_max(
            {
                frame: frame,
                name: incident.name,
                measurement_id: incident.measurement_id,
                alternatives: CASE WHEN own_attacked = incident.attacked THEN incident.alternatives END,
                posterior: incident.posterior,
                gap: gap
            },
            {
                own: own_kind = incident.kind AND own_attacked = incident.attacked,
                kind: own_kind = incident.kind,
                gap: gap,
                place: place,
                frame: frame
            }
        ) FILTER (gap IS NOT NULL AND own_kind <> 'clean') AS strongest,
        count(*) FILTER (own_kind IN ('attacked', 'unidentified', 'suspect')) AS findings,
        NOT bool_or(own_kind = incident.kind) AS of_all,
        max(posterior) FILTER (own_kind <> 'clean') AS posterior,
        max(log10_ratio) FILTER (own_kind <> 'clean') AS log10_ratio,
        any_value(largest_ratio) AS largest_ratio,
        list_distinct(flatten(list(incident.causes) FILTER (own_kind <> 'clean'))) AS causes
    FROM numbered AS incident
    JOIN (SELECT measurement_id, matcher, measured_at, drive_id, clock, sensors FROM placed) AS about
        ON about.measurement_id = incident.measurement_id
    GROUP BY line, incident.kind, incident.attacked, run
    HAVING bool_or(wanted)
),
told AS (
    SELECT
        name_of_incident(
            whole.parts[1].recording_id, grouped.rig_id, grouped.matcher, whole.parts[1].from_ns
        ) AS begins,
        grouped.measured_at,
        whole.parts[1].recording_id AS recording_id,
        whole.parts[1].name AS name,
        grouped.vehicle,
        grouped.drive_id,
        whole.parts[1].measurement_id AS measurement_id,
        whole.parts[1].judgement_id AS judgement_id,
        grouped.rig_id,
        CASE WHEN grouped.alert THEN 'alert' ELSE 'incident' END AS grade,
        grouped.kind,
        grouped.attacked,
        names_of(grouped.attacked, grouped.sensors) AS attacked_names,
        grouped.from_ns,
        grouped.to_ns,
        (grouped.to_ns - grouped.from_ns) / 1e9 AS seconds,
        CASE WHEN grouped.clock = 'utc' THEN make_timestamp_ns(grouped.from_ns) END AS from_utc,
        grouped.frames,
        whole.parts[1].first_frame AS first_frame,
        whole.parts[-1].last_frame AS last_frame,
        whole.parts,
        strongest.frame AS strongest_frame,
        strongest.name AS strongest_name,
        strongest.measurement_id AS strongest_measurement_id,
        strongest.gap AS largest_gap,
        grouped.findings = 0
            OR carried.evidence IS NULL AND grouped.kind = 'attacked' AND grouped.largest_ratio IS NOT NULL AS weak,
        CASE
            WHEN weak THEN 'no single frame: weak evidence that lasts'
            WHEN grouped.of_all THEN format('{}; no single frame is {} by itself: what lasts is', carried.evidence, grouped.kind)
            ELSE carried.evidence
        END AS evidence,
        shared.shares,
        alternatives_in_words(
            list_filter(strongest.alternatives, lambda other: other['attacked'] <> grouped.attacked), strongest.posterior
        ) AS alternatives,
        grouped.posterior,
        grouped.log10_ratio,
        ratio_in_words(grouped.log10_ratio, grouped.largest_ratio, grouped.kind) AS ratio,
        causes_in_words(grouped.causes) || CASE WHEN grouped.of_all THEN ', of single frames and not of what lasts' ELSE '' END AS causes,
        [sensor.topic FOR sensor IN grouped.sensors] AS topics,
        [sensor.topic FOR sensor IN grouped.sensors IF list_contains(grouped.attacked, sensor.sensor)] AS attacked_topics,
        [
            sensor.topic FOR sensor IN grouped.sensors
            IF list_contains([cause.sensor FOR cause IN grouped.causes], sensor.sensor)
        ] AS explained_topics,
        {
            alert: grouped.alert,
            weak: grouped.findings = 0,
            unnamed: grouped.kind <> 'attacked',
            seconds: grouped.from_ns - grouped.to_ns,
            findings: -grouped.findings,
            gap: -coalesce(strongest.gap, 0)
        } AS place_among_rigs
    FROM grouped
    JOIN whole USING (line, kind, attacked, run)
    LEFT JOIN carried USING (line, kind, attacked, run)
    LEFT JOIN shared USING (line, kind, attacked, run)
),
-- A recording may be measured in several ways, and repeat its stamps: the latest measurement has the plain name.
found AS (
    SELECT
        CASE WHEN place = 1 THEN begins ELSE md5(begins || ' ' || place) END AS incident_id,
        * EXCLUDE (begins, measured_at, place)
    FROM (
        SELECT *, row_number() OVER (PARTITION BY begins ORDER BY measured_at DESC, measurement_id, first_frame) AS place
        FROM told
    )
),
-- Rigs of one recording share sensors: what one of them names, others see as well, and name it or cannot. What no frame
-- says by itself takes the place of nothing that frames do say.
same AS (
    SELECT
        found.incident_id,
        arg_min(other.incident_id, {place: other.place_among_rigs, id: other.incident_id}) AS same_as
    FROM found
    JOIN found AS other
        ON other.drive_id = found.drive_id
            AND other.rig_id <> found.rig_id
            AND list_has_any([part.recording_id FOR part IN other.parts], [part.recording_id FOR part IN found.parts])
            AND other.from_ns <= found.from_ns + $gap_s * 1e9
            AND other.to_ns >= found.to_ns - $gap_s * 1e9
            AND {place: other.place_among_rigs, id: other.incident_id}
                < {place: found.place_among_rigs, id: found.incident_id}
            AND CASE
                WHEN other.kind = 'suspect'
                    THEN found.kind = 'suspect' AND list_sort(found.explained_topics) = list_sort(other.explained_topics)
                WHEN other.kind = 'attacked' AND found.kind = 'attacked'
                    THEN list_sort(found.attacked_topics) = list_sort(other.attacked_topics)
                WHEN other.kind = 'attacked'
                    THEN found.kind = 'unidentified' AND NOT other.place_among_rigs.weak
                        AND list_has_all(found.topics, other.attacked_topics)
                ELSE found.kind = 'attacked' AND found.place_among_rigs.weak
                    AND list_has_all(other.topics, found.attacked_topics)
            END
    GROUP BY found.incident_id
),
last AS (
    SELECT found.incident_id, arg_max(reviews, {moment: reviews.reviewed_at, id: reviews.review_id}) AS review
    FROM found
    JOIN reviews ON is_one_incident(
        list_concat([part.recording_id FOR part IN found.parts], [found.drive_id]),
        found.attacked_names, found.from_ns, found.to_ns,
        reviews.places, reviews.sensors, reviews.from_ns, reviews.to_ns
    )
    GROUP BY found.incident_id
),
reviewed AS (
    SELECT found.incident_id, same.same_as, coalesce(last.review, of_same.review) AS review
    FROM found
    LEFT JOIN same USING (incident_id)
    LEFT JOIN last USING (incident_id)
    LEFT JOIN last AS of_same ON of_same.incident_id = same.same_as
)
SELECT
    found.* EXCLUDE (topics, attacked_topics, explained_topics, place_among_rigs),
    reviewed.same_as,
    CASE WHEN reviewed.review.in_effect THEN reviewed.review.verdict END AS review,
    CASE WHEN reviewed.review.in_effect THEN reviewed.review.reason END AS review_reason,
    CASE WHEN reviewed.review.in_effect THEN (reviewed.review.to_ns - reviewed.review.from_ns) / 1e9 END AS reviewed_seconds
FROM found
JOIN reviewed USING (incident_id)
ORDER BY name, from_ns, kind, attacked, first_frame

-- Truth against verdict, counted: all verdicts on clean and on attacked frames at one r.
--
-- param r RATE = 0.01: The designated false-alarm rate.
-- param statistic STATISTIC = gated: Which pixels E counts: plain or gated.
-- param block_frames BIGINT = 10: Frames that are left out together, in blocks of time.
--
-- column setup: What was pooled: one rig kind, one way of measuring, real or synthetic drives.
-- column method: How cases were judged: paper (E and Algorithm 2) or robust, which has been at r = 1 % only.
-- column left_out: What theta was not taken from: nothing (in sample), the block of the frame, its recording, or its family.
-- column system: The sensors that took part.
-- column strength: Amplitude of the faculas by name; NULL for clean frames.
-- column attacked: The attacked sensors; empty for clean frames.
-- column verdict: clean, attacked, unidentified, suspect or not_auditable.
-- column identified: The sensors that the verdict names; empty unless it is attacked.
-- column cases: Frames.
WITH verdict_of AS (
    FROM verdicts_by_method(cases, paper_triples, case_verdicts, [$r], $statistic, $block_frames)
)
SELECT
    setup,
    method,
    left_out,
    system,
    strength,
    attacked,
    verdict,
    CASE WHEN verdict = 'attacked' THEN named ELSE [] END AS identified,
    CAST(sum(cases) AS BIGINT) AS cases
FROM verdict_of
WHERE experiment IN ('clean', 'combinations')
GROUP BY ALL
ORDER BY setup, method, left_out, system, strength NULLS FIRST, attacked, verdict, identified

-- What the incident report draws of a measurement: the verdict and the ground truth of each judged frame.
--
-- param measurement VARCHAR: The measurement.
--
-- column frame: Number of the frame within the recording.
-- column stamp_ns: The frame's stamp: when it was captured.
-- column kind: clean, attacked, unidentified, suspect or not_auditable.
-- column attacked: The sensors that the verdict names; empty unless kind is attacked.
-- column out_of_system: The sensors that it was judged without.
-- column evidence: What exceeded its threshold and how far, the strongest first.
-- column alternatives: The next-best explanations, in words.
-- column causes: What else than an attack may lie behind it, in words.
-- column truth: The sensors that labels say were attacked, ascending; empty where no label covers the frame.
-- column labelled: TRUE where the recording has labels at all.
SELECT
    verdict.frame,
    verdict.stamp_ns,
    verdict.kind,
    verdict.attacked,
    verdict.e,
    verdict.reason,
    CASE WHEN NOT coalesce(verdict.alert, false) THEN verdict.finding END AS finding,
    CASE WHEN NOT coalesce(verdict.alert, false) THEN verdict.finding_attacked END AS finding_attacked,
    verdict.out_of_system,
    verdict.evidence,
    alternatives_in_words(verdict.alternatives, verdict.posterior) AS alternatives,
    causes_in_words(verdict.causes) AS causes,
    truth.truth,
    truth.labelled
FROM verdicts AS verdict
JOIN truth USING (measurement_id, frame)
WHERE verdict.measurement_id = $measurement
ORDER BY verdict.stamp_ns, verdict.frame

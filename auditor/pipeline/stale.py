"""Which verdicts are those that would be reached now: such a measurement need not be judged again."""

from collections.abc import Sequence

from auditor.identification.parameters import judging_digest
from auditor.identification.sub_rigs import calibration_for
from auditor.identification.thresholds import check_calibration
from auditor.model.calibration import Calibration
from auditor.model.rig_kind import Similarity
from auditor.model.verdict import Method
from auditor.pipeline.judge import Criteria
from auditor.store import Store, StoredJudgement
from auditor.store.records import judgement_id


def is_as_now(
    judgement: StoredJudgement, store: Store, calibration: Calibration, criteria: Criteria, beside: Sequence[str] = ()
) -> bool:
    """Whether judging its measurement by a calibration, `beside` others of its recording, would give this again.

    Raises ThresholdsError where the calibration does not fit.
    """
    stored = store.measurement(judgement.measurement_id)
    rig = store.rig(stored.rig_id)
    similarity = check_calibration(
        calibration_for(calibration, rig) or calibration,
        rig_kind=rig.kind,
        procedure=stored.procedure,
        transfer=criteria.transfer,
    )
    robust = criteria.method is Method.ROBUST
    now = judgement_id(
        judgement.measurement_id,
        calibration.calibration_id,
        criteria.method,
        repr(criteria.incidents_per_hour) if robust else criteria.statistic.value,
        criteria.r,
        judging_digest(),
        transferred=similarity is not Similarity.SAME,
        recounted=criteria.recount,
        judged_with=tuple(beside),
    )
    return now == judgement.judgement_id

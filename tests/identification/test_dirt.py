"""What stays in a lone camera's picture is suspect: light may be thrown so, and dirt lies so."""

from auditor.identification.faults import weigh
from auditor.model.checks import Check
from auditor.model.rig import LIDAR
from auditor.model.verdict import Cause, Evidence, Verdict, VerdictKind

LIMIT = 3.0


def weighed(*fired: tuple[Check, float]) -> Verdict:
    """A finding of a camera and its past, by these checks with their scores."""
    evidence = tuple(
        Evidence(check.value, 1 if check is not Check.PARALLAX_CONFLICT else LIDAR, None, None, score)
        for check, score in fired
    )
    return weigh(Verdict(VerdictKind.ATTACKED, "1", (1,), evidence=evidence), (), LIMIT)


def test_still_texture_alone_is_suspect_and_dirt_is_its_cause() -> None:
    verdict = weighed((Check.STILL_TEXTURE, 6.0), (Check.PARALLAX_CONFLICT, 4.0))
    assert verdict.kind is VerdictKind.SUSPECT
    assert [(one.cause, one.sensor) for one in verdict.causes] == [(Cause.SOILED, 1)]
    assert verdict.alternatives[0].attacked == (1,)


def test_still_light_that_is_stronger_is_an_attack() -> None:
    assert weighed((Check.STILL_TEXTURE, 4.0), (Check.STILL_LIGHT, 6.0)).kind is VerdictKind.ATTACKED
    assert weighed((Check.STILL_LIGHT, 6.0)).kind is VerdictKind.ATTACKED

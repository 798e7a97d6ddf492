"""An audit as SARIF or JUnit, for continuous integration."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from auditor.cli.exit_codes import Tally

if TYPE_CHECKING:
    from auditor.reporting.ci.policy import Decided
    from auditor.store import Store

FORMS_OF_CI = ("sarif", "junit")


def as_form_of_ci(
    form: str,
    store: "Store | None",
    recordings: Sequence[Mapping[str, Any]],
    decided: "Sequence[Decided]",
    tally: Tally,
) -> bytes:
    """The text of an audit in one of FORMS_OF_CI. `recordings` are rows of the view `summary`."""
    from auditor.reporting.ci.audit import Audit, Left  # noqa: PLC0415 - keeps --help quick
    from auditor.reporting.ci.junit import junit  # noqa: PLC0415
    from auditor.reporting.ci.sarif import sarif  # noqa: PLC0415

    paths = {one.recording_id: one.path for one in store.recordings()} if store is not None else {}
    left = [Left(one.recording, one.path, one.reason) for one in tally.not_audited]
    audit = Audit(recordings, paths, decided, left, int(tally.exit_code()))
    return {"sarif": sarif, "junit": junit}[form](audit).encode()
